"""Pooled rows of a suite that docs/drives.py and docs/control_suite.py make their tables of."""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from flexaxis.experiments.cli import main as main_of_command

HOME = Path(__file__).parent
MARK = re.compile(r"<!-- table: ([\w-]+) -->\n(.*?)<!-- end -->", re.DOTALL)
SEEDS = 20
GEARED = "glr[gear=true]"
WHO = {
    "drives": (
        "glr",
        GEARED,
        "rpem-friction",
        "rpem-friction-drift",
        "ekf",
        "rpem-forgetting",
        "frozen",
    ),
    "control": (
        "glr",
        GEARED,
        "rpem-friction",
        "ekf",
        "rpem-forgetting",
        "rpem-drift",
        "cusum-reset",
    ),
}


@cache
def results(suite: str) -> Any:
    """Return the pooled rows of a suite, by scenario, estimator and parameter."""
    folder = HOME.parent / "results" / suite
    if not (folder / "summary.json").exists():
        who = [word for name in WHO[suite] for word in ("--estimator", name)]
        seeds = f"1000:{1000 + SEEDS}"
        main_of_command(["run", suite, *who, "--seeds", seeds, "-o", str(folder)])
    rows = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["rows"]
    return {(r["scenario"], r["estimator"], r["parameter"]): r for r in rows}


def changed(suite: str, scenario: str, estimator: str) -> Mapping[str, Any] | None:
    """Return the row of the parameter that fails, or of the first where that is not estimated."""
    rows = [r for (s, e, _), r in results(suite).items() if (s, e) == (scenario, estimator)]
    return next((r for r in rows if r["changed"]), rows[0] if rows else None)


def said(suite: str) -> str:
    """Return what a table is of."""
    seeds = next(iter(results(suite).values()))["seeds"]
    return f"\n`flexaxis run {suite}`, seeds 1000 to {999 + seeds}, `python docs/{suite}.py`.\n"


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def write(page: Path, tables: Mapping[str, Callable[[], str]], wanted: Sequence[str]) -> None:
    """Write the tables of a page that are wanted, all if none is named."""

    def written(match: re.Match[str]) -> str:
        name = match[1]
        body = tables[name]() if not wanted or name in wanted else match[2]
        return f"<!-- table: {name} -->\n{body}<!-- end -->"

    page.write_text(MARK.sub(written, page.read_text(encoding="utf-8")), encoding="utf-8")
