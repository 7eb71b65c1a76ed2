"""What the scripts share that make tables of the documentation, at a commit that is said below.

A table stands between `<!-- table: NAME -->` and `<!-- end -->`. What it is made of is kept in
`results/`, with commit and digest, and made again where the digest is not that of today's code.
"""

import json
import re
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from digests import ROOT, git, stamp

RESULTS = ROOT / "results"
MARK = re.compile(r"<!-- table: ([\w-]+) -->\n(.*?)<!-- end -->", re.DOTALL)
CODE = ("models_mjcf", "sim", "estimators", "experiments", "docs/*.py")


def write(page: Path, tables: Mapping[str, Callable[[], str]], words: Sequence[str] = ()) -> None:
    """Write the tables of a page that words of the command line name, all if none does."""
    if wrong := set(words) - set(tables):
        sys.exit(f"no table {min(wrong)!r}: {', '.join(tables)}")
    for name, _ in MARK.findall(page.read_text(encoding="utf-8")):
        if name in (words or tables):
            whole = f"<!-- table: {name} -->\n{tables[name]()}<!-- end -->"
            text = page.read_text(encoding="utf-8")
            text = MARK.sub(lambda m, n=name, w=whole: w if m[1] == n else m[0], text)
            page.write_text(text, encoding="utf-8")
            print(f"{page.relative_to(ROOT)}: {name}", flush=True)


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(_cell(c) for c in line)} |\n" for line in lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def commit() -> str:
    """Return commit and digest of what is here; a table of code that is in none is refused."""
    if changed := git("status", "--porcelain", "--", *CODE).decode():
        sys.exit(f"a table says of which commit it is: commit this first\n{changed}")
    return f"{git('rev-parse', '--short=8', 'HEAD').decode().strip()}, digest {stamp()}"


def commit_of(name: str) -> str:
    """Return at which commit results were made, and the digest; nothing where there are none."""
    path = RESULTS / name / "commit"
    return path.read_text(encoding="utf-8") if path.exists() else ""


def kept(name: str, make: Callable[[], Any]) -> Any:
    """Return results of that name, made where they are not of today's code."""
    if not commit_of(name).endswith(f"digest {stamp()}"):
        _made(name, lambda: _write(name, make()))
    return json.loads((RESULTS / name / "rows.json").read_text(encoding="utf-8"))


@cache
def summary(name: str, *words: str) -> Any:
    """Return the summary of a run, made where it is not of today's code."""
    place = RESULTS / name
    if not commit_of(name).endswith(f"digest {stamp()}"):
        _made(name, lambda: call("run", *words, "-o", str(place), "--overwrite"))
    return json.loads((place / "summary.json").read_text(encoding="utf-8"))


def _made(name: str, make: Callable[[], Any]) -> None:
    """Make results, and write of which commit they are when they are there."""
    at, path = commit(), RESULTS / name / "commit"
    path.unlink(missing_ok=True)
    make()
    path.write_text(at, encoding="utf-8")


def _write(name: str, rows: Any) -> None:
    (RESULTS / name).mkdir(parents=True, exist_ok=True)
    (RESULTS / name / "rows.json").write_text(json.dumps(rows), encoding="utf-8")


def call(*words: str) -> str:
    """Run a command of flexaxis, its progress on the terminal, and return what it printed."""
    done = subprocess.run(
        [sys.executable, "-m", "flexaxis.experiments", *words], stdout=subprocess.PIPE, check=False
    )
    if done.returncode not in (0, 1):
        sys.exit(f"flexaxis {' '.join(words)} ended with status {done.returncode}")
    return done.stdout.decode()
