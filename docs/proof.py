"""Prove a commit: `make release` runs all that can tell of it, and writes docs/proof.md.

A stage is keyed by a digest of its command, of the files that it depends on and of all libraries.
Where a stage only runs code, comments and docstrings do not count; where it looks at the text
(style, tests, documentation) all does. A stage whose digest is in docs/proof.md is not run again,
so that after a stop only what is missing is. With names of stages only these are run; `--stale`
runs nothing, and says which tables of the documentation, and which stages, are of other code than
today's: of a table by the digest below it, which is of code and data, and of the libraries, or by
its commit.
"""

import hashlib
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from digests import NOT, NUMBERS, OF_LOGS, PACKAGE, ROOT, digest, git, installed, libraries
from making import table

PAGE = ROOT / "docs" / "proof.md"
MARK = re.compile(r"(<!-- table: proof -->\n)(.*?)(<!-- end -->)", re.DOTALL)
RUNS = (*PACKAGE, "pyproject.toml", "Makefile")
# new tables and figures make no long test one of other code: `slow` reads none of these
MEASURED = ("control.md", "demo.md", "drives.md", "friction.md", "gate.md", "glr.md", "logs.md",
            "scenarios.md", "scores.md", "speed.md", "data", "images")  # fmt: skip
TEXT = (".", *(f"{NOT}docs/{name}" for name in MEASURED))
# what stands below a table: its commit, and the digest of code and libraries
BELOW = re.compile(
    r"\bcommit ([0-9a-f]{7,40})(-dirty)?(?:, digest ([0-9a-f]{10}(?:-[0-9a-f]{6})?))?"
)
PROOF, PAGES = re.compile("docs/proof.md"), re.compile(r"README\.md|docs/.*\.(md|png)")
SAYS = 90  # characters of what a stage said last
ALONE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


@dataclass(frozen=True)
class Stage:
    """A command that must end with 0, what it shows, and the files that may change that.

    Without files it looks at all of them, text and comments included, and with "." at all but those
    that it leaves out. One that writes pages of the documentation leaves them to be committed,
    before what looks at all files.
    """

    command: str
    shows: str
    runs: tuple[str, ...] = ()
    writes: bool = False


def _makes(command: str, shows: str, *files: str) -> Stage:
    """Return a stage that makes tables and figures of the documentation."""
    return Stage(command, shows, (*NUMBERS, "docs/making.py", *files), True)


SUITE = ("docs/suite_rows.py",)
STAGES = {
    "check": Stage("make check", "style, types, architecture"),
    "test": Stage("make test", "the fast tests, none skipped for bubblewrap"),
    "mutants": Stage("make mutants JOBS=2", "every planted error is seen by a test",
                     (*RUNS, "tests", f"{NOT}tests/browser", "docs/proof.py", "docs/digests.py")),
    "fuzz": Stage("make fuzz MINUTES=5", "bad files lead to a message",
                  (*RUNS, "tests/fuzz", "docs/examples")),
    "kills": Stage("make kill KILLS=100", "what is killed goes on, nothing torn or lost",
                   (*RUNS, "tests/experiments/kills.py", "tests/experiments/kept_rows.py")),
    "standard": Stage("flexaxis run standard --seeds 5 -o results/release --overwrite",
                      "every estimator on the standard suite, five seeds", RUNS),
    "tables": _makes("python docs/tables.py && python docs/fm_step.py",
                     "tables of scenarios.md, scores.md and gate.md, the figure of README.md",
                     "docs/tables.py", "docs/fm_step.py"),
    "demo": _makes("python docs/demo.py", "the table of demo.md", "docs/demo.py"),
    "friction": _makes("python docs/friction.py", "tables and figure of friction.md",
                       "docs/friction.py", "tests/estimators/test_laws.py"),
    "drives": _makes("python docs/drives.py", "tables and figure of drives.md",
                     "docs/drives.py", *SUITE),
    "control": _makes("python docs/control_suite.py", "tables of control.md",
                      "docs/control_suite.py", *SUITE),
    "glr": _makes("python docs/glr.py --jobs 2 && python docs/glr_shapes.py && "
                  "python docs/glr_bank.py", "tables and figure of glr.md",
                  "docs/glr*.py", "docs/speed_st*.py", "docs/data"),
    # apart, so that nothing else is shown beside the libraries that it compares with
    "speed": _makes("make docs-speed VENV=.venv-peers", "tables of speed.md", "docs/speed*.py"),
    "slow": Stage("python -m pytest -q -n 2 --dist=loadfile --durations=40 -m slow "
                  "--ignore tests/mutants --ignore tests/test_site.py",
                  "the long tests: labs, notebooks, lessons, all claims of the paper, each cheater "
                  "of a board ten times", TEXT),
    "browser": Stage("make test-browser", "pages and demo in Chromium"),
    "site": Stage("python -m pytest -q -m slow tests/test_site.py && make site",
                  "the documentation, with its links and formulas"),
    "wheel": Stage("make dist", "wheel and source archive"),
}  # fmt: skip


def key(stage: Stage, of: Callable[[tuple[str, ...]], str] = digest) -> str:
    """Return the digest of all that a stage depends on."""
    parts = [stage.command, of(stage.runs), libraries() if stage.writes else installed()]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:10]


def stale() -> list[str]:
    """Return which tables and stages are of other code than what is here, a line each."""
    found, once = [], cache(digest)
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        parts = OF_LOGS if page.name == "logs.md" else NUMBERS
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
            for ref, dirty, said in BELOW.findall(line):
                if why := _why(ref, dirty, said, parts, once):
                    found.append(f"{page.relative_to(ROOT)}:{number}: of {ref}{dirty}, {why}")
    known, keys = rows(), {n: key(s, once) for n, s in STAGES.items()}
    told = {n: "never" if n not in known else f"at {known[n][1]}" for n in STAGES}
    return found + [f"{n}: shown {told[n]}" for n in STAGES if known.get(n, "-")[0] != keys[n]]


def _why(
    ref: str, dirty: str, said: str, parts: tuple[str, ...], digest: Callable[..., str]
) -> str:
    """Return what is old in a table: nothing where digest or commit is of today's code."""
    code, _, with_ = said.partition("-")
    try:
        if dirty:
            return "code that is in no commit"
        if (now := digest(parts)) != code and now != digest(parts, ref):
            changes = git("rev-list", "--count", f"{ref}..HEAD", "--", *parts)
            return f"{int(changes)} commits ago"
    except subprocess.CalledProcessError:
        return "which is not in this history"
    return "with other libraries" if with_ and with_ != libraries() else ""


def rows() -> dict[str, list[str]]:
    """Return what docs/proof.md has of each stage: digest, commit, how long, what it said."""
    text = MARK.search(PAGE.read_text(encoding="utf-8"))
    lines = [re.split(r"(?<!\\) \| ", line[2:-2]) for line in text[2].splitlines()[2:]]
    texts = [[cell.replace("\\|", "|") for cell in cells] for cells in lines if len(cells) == 6]
    return {cells[0].strip("`"): cells[2:] for cells in texts if cells[2] != "–"}


def run(name: str) -> bool:
    """Run a stage unless its digest stands there already; return whether it holds."""
    stage = STAGES[name]
    before = key(stage)
    if rows().get(name, [""])[0] == before:
        print(f"{name}: as in docs/proof.md", flush=True)
        return True
    if changed := _changed(stage):
        sys.exit(f"only a commit can be proved: commit this first\n{changed}")
    print(f"{name}: {stage.command}", flush=True)
    at, began = git("rev-parse", "--short=8", "HEAD").decode().strip(), time.monotonic()
    status, said = _said(stage.command)
    took = f"{(time.monotonic() - began) / 60:.1f} min"
    if status:
        print(f"{name} ended with status {status}; what was shown before is kept")
        return False
    if key(stage) != before or _changed(stage):
        print(f"{name}: files have changed while it ran, so that it shows nothing; once more")
        return False
    write(rows() | {name: [before, at, took, said]})
    return True


def _changed(stage: Stage) -> str:
    """Return what is in no commit, but for this page and, where a stage writes them, all pages."""
    lines = git("status", "--porcelain").decode().splitlines()
    known = PAGES if stage.writes else PROOF
    return "\n".join(line for line in lines if not known.fullmatch(line[3:]))


def _said(command: str) -> tuple[int, str]:
    """Run a command, its output on the terminal; return its status and its last words."""
    own = {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    kept = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    kept.pop("MFLAGS", None)  # of the make that started this: another one would tell where it is
    environment = kept | own | ALONE | {"FLEXAXIS_RELEASE": "1"}
    last = "nothing"
    with subprocess.Popen(command, shell=True, cwd=ROOT, env=environment, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:  # fmt: skip
        for line in process.stdout:
            print(line, end="", flush=True)
            last = line.strip(" =\n") or last
    return process.returncode, last.replace(f"{ROOT}{os.sep}", "")[:SAYS]


def write(known: dict[str, list[str]]) -> None:
    """Write what is known into docs/proof.md."""
    missing = ["–", "–", "–", "not run"]
    lines = [[f"`{n}`", s.shows, *known.get(n, missing)] for n, s in STAGES.items()]
    text = table(["stage", "shows", "digest", "commit", "took", "said"], lines)
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(MARK.sub(lambda m: m[1] + text + m[3], page), encoding="utf-8")


def main(words: list[str]) -> int:
    """Run what is named, or all."""
    if "--stale" in words:
        if not (ROOT / ".git").exists():
            print("no repository here: it cannot be told which tables are of older code")
        else:
            print("\n".join(stale()) or "every table and every stage is of today's code")
        return 0
    if wrong := set(words) - set(STAGES):
        sys.exit(f"no stage {min(wrong)!r}: {', '.join(STAGES)}")
    held = [run(name) for name in words or STAGES]
    return int(not all(held))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
