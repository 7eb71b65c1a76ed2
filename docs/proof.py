"""Prove a commit: `make release` runs all that can tell of it, and writes docs/proof.md.

A stage is keyed by a digest of what it depends on: code without comments and docstrings, other
files as they are, versions of Python and of the libraries. A stage whose digest is in docs/proof.md
is not run again, so that after a stop or a small change only what is missing is. With names of
stages only these are run; `--stale` runs nothing, and says which tables of the documentation are of
other code than today's.
"""

import ast
import hashlib
import re
import subprocess
import sys
import tarfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import distributions
from io import BytesIO
from pathlib import Path

from tables import ROOT, commit, table

PAGE = ROOT / "docs" / "proof.md"
MARK = re.compile(r"(<!-- table: proof -->\n)(.*?)(<!-- end -->)", re.DOTALL)
LIBRARIES = ("mujoco", "numpy", "scipy", "numba", "llvmlite", "control", "pandas", "xarray")
NUMBERS = ("models_mjcf", "sim", "estimators", "experiments/scoring")  # what makes an estimate
CODE = (*NUMBERS, "experiments", "pyproject.toml", "Makefile")
TESTS, DOCS = (*CODE, "tests"), (*CODE, "docs", "README.md")
ALL = (*TESTS, "docs", "README.md")
SAYS = 90  # characters of what a stage said last


@dataclass(frozen=True)
class Stage:
    """A command that must end with 0, what it shows, and the files that may change it."""

    command: str
    shows: str
    of: tuple[str, ...]


PYTEST = "-m pytest -q -n 2 --dist=loadfile -p no:cacheprovider"
STAGES = {
    "check": Stage("make check", "style, types, architecture", ALL),
    "test": Stage("make test", "the fast tests", ALL),
    "slow": Stage(f"FLEXAXIS_RELEASE=1 python {PYTEST} -m slow --deselect tests/mutants",
                  "the long tests: labs, notebooks, lessons, all 44 claims of the paper, cheaters "
                  "of a board ten times", ALL),
    "browser": Stage("make test-browser", "pages and demo in Chromium", ALL),
    "mutants": Stage("make mutants JOBS=2", "every planted error is seen by a test", TESTS),
    "fuzz": Stage("make fuzz MINUTES=10", "bad files lead to a message", TESTS),
    "kills": Stage("make kill KILLS=100", "what is killed goes on, nothing torn or lost", TESTS),
    "standard": Stage("flexaxis run standard --seeds 20 -o results/standard --overwrite",
                      "the suite that tables of scores are of", CODE),
    "site": Stage("make site", "the documentation, with its links", DOCS),
    "wheel": Stage("make dist", "wheel and source archive", ALL),
}  # fmt: skip


def digest(parts: tuple[str, ...], ref: str = "") -> str:
    """Return what tells files from any others: those here, or those of a commit."""
    total = hashlib.sha256()
    for name, content in sorted(_files(parts, ref)):
        if name != "docs/proof.md":
            total.update(f"{name}\n".encode() + _meant(name, content))
    return total.hexdigest()[:10]


def _files(parts: tuple[str, ...], ref: str) -> Iterator[tuple[str, bytes]]:
    if ref:
        with tarfile.open(fileobj=BytesIO(_git("archive", ref))) as archive:
            for member in archive:  # some of the parts may not be in it yet
                if member.isfile() and any(f"{member.name}/".startswith(f"{p}/") for p in parts):
                    yield member.name, archive.extractfile(member).read()
        return
    listed = _git("ls-files", "-co", "--exclude-standard", "--", *parts).decode().splitlines()
    for name in listed:
        if (ROOT / name).is_file():
            yield name, (ROOT / name).read_bytes()


def _meant(name: str, content: bytes) -> bytes:
    """Return a file without what changes nothing: comments and docstrings of code."""
    if not name.endswith(".py"):
        return content
    tree = ast.parse(content)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        first = body[0] if isinstance(body, list) and body else None
        if isinstance(first, ast.Expr) and isinstance(getattr(first.value, "value", None), str):
            body[0] = ast.Pass()
    return ast.dump(tree).encode()


def _git(*words: str) -> bytes:
    return subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, check=True).stdout


@cache
def libraries() -> str:
    """Return the versions that numbers may depend on."""
    found = {d.metadata["Name"].lower(): d.version for d in distributions()}
    ours = [f"{name} {found[name]}" for name in LIBRARIES if name in found]
    return ", ".join([f"Python {sys.version.split()[0]}", *ours])


def key(stage: Stage) -> str:
    """Return the digest of all that a stage depends on."""
    return hashlib.sha256(f"{digest(stage.of)}\n{libraries()}".encode()).hexdigest()[:10]


def stale() -> list[str]:
    """Return which tables are of code that has changed since, a line each."""
    found, now = [], digest(NUMBERS)
    then = cache(lambda ref: digest(NUMBERS, ref))
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        if page == PAGE:
            continue
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
            for ref, dirty in re.findall(r"\bcommit ([0-9a-f]{7,40})(-dirty)?\b", line):
                place = f"{page.relative_to(ROOT)}:{number}"
                try:
                    same = not dirty and then(ref) == now
                    since = "" if same else f"{_changes(ref)} commits of code ago"
                except subprocess.CalledProcessError:
                    same, since = False, "which is not in this history"
                if not same:
                    found.append(f"{place}: of {ref}{dirty}, {since}")
    return found


def _changes(ref: str) -> int:
    return int(_git("rev-list", "--count", f"{ref}..HEAD", "--", *NUMBERS))


def rows() -> dict[str, list[str]]:
    """Return what docs/proof.md says of each stage: digest, commit, how long, what it said."""
    text = MARK.search(PAGE.read_text(encoding="utf-8"))
    lines = [re.split(r"(?<!\\) \| ", line.strip("| ")) for line in text[2].splitlines()[2:]]
    texts = [[cell.replace("\\|", "|") for cell in cells] for cells in lines if len(cells) == 6]
    return {cells[0].strip("`"): cells[2:] for cells in texts}


def run(name: str) -> bool:
    """Run a stage unless its digest stands there already; return whether it holds."""
    stage, known = STAGES[name], rows()
    if known.get(name, [""])[0] == key(stage):
        print(f"{name}: as in docs/proof.md", flush=True)
        return True
    print(f"{name}: {stage.command}", flush=True)
    at, before, began = commit(), key(stage), time.monotonic()
    place = f"PATH={Path(sys.executable).parent}:$PATH; {stage.command}"
    done = subprocess.run(["bash", "-o", "pipefail", "-c", f"({place}) 2>&1 | tee /dev/stderr"],
                          cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)  # fmt: skip
    took = f"{(time.monotonic() - began) / 60:.1f} min"
    said = [line.strip(" =") for line in done.stdout.splitlines() if line.strip(" =")]
    if done.returncode:
        print(f"{name} ended with status {done.returncode}; what was shown before is kept")
        return False
    known[name] = [before, at, took, (said or ["nothing"])[-1][:SAYS]]
    write(known)
    return True


def write(known: dict[str, list[str]]) -> None:
    """Write what is known into docs/proof.md."""
    missing = ["–", "–", "–", "not run"]
    lines = [[f"`{n}`", s.shows, *known.get(n, missing)] for n, s in STAGES.items()]
    text = table(["stage", "shows", "digest", "commit", "took", "said"], lines)
    text += f"\nWith {libraries()}.\n"
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(MARK.sub(lambda m: m[1] + text + m[3], page), encoding="utf-8")


def main(words: list[str]) -> int:
    """Run what is named, or all."""
    if "--stale" in words:
        print("\n".join(stale()) or "every table is of today's code")
        return 0
    if wrong := set(words) - set(STAGES):
        sys.exit(f"no stage {min(wrong)!r}: {', '.join(STAGES)}")
    held = [run(name) for name in words or STAGES]
    return int(not all(held))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
