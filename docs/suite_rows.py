"""Pooled rows of a suite that docs/drives.py and docs/control_suite.py make their tables of."""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from making import ROOT, VERSION

from flexaxis.experiments.cli import main

HOME = Path(__file__).parent
SEEDS = 20
GEARED = "glr[gear=true]"
WHO = {
    "drives": (
        "glr",
        GEARED,
        "ekf",
        "rpem-forgetting",
        "frozen",
    ),
    "control": (
        "glr",
        GEARED,
        "ekf",
        "rpem-forgetting",
        "rpem-drift",
        "cusum-reset",
    ),
}


@cache
def summary(*words: str) -> Any:
    """Return the summary of `flexaxis run` with these words, in `results/docs/FIRST_WORD`.

    A run that is there is completed; one of other code is refused, and has to be removed first.
    """
    folder = ROOT / "results" / "docs" / words[0]
    if main(["run", *words, "-o", str(folder)]) > 1:
        raise SystemExit(f"flexaxis run {' '.join(words)} failed")
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


@cache
def results(suite: str) -> Any:
    """Return the pooled rows of a suite, by scenario, estimator and parameter."""
    who = [word for name in WHO[suite] for word in ("--estimator", name)]
    rows = summary(suite, *who, "--seeds", f"1000:{1000 + SEEDS}")["rows"]
    return {(r["scenario"], r["estimator"], r["parameter"]): r for r in rows}


def changed(suite: str, scenario: str, estimator: str) -> Mapping[str, Any] | None:
    """Return the row of the parameter that fails, or of the first where that is not estimated."""
    rows = [r for (s, e, _), r in results(suite).items() if (s, e) == (scenario, estimator)]
    return next((r for r in rows if r["changed"]), rows[0] if rows else None)


def said(suite: str, script: str) -> str:
    """Return what a table is of."""
    run = f"Suite `{suite}`, seeds 1000 to {999 + SEEDS}"
    return f"\n{run}, `python docs/{script}.py`, {VERSION}.\n"
