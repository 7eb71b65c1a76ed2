"""The HTML report of a study: a table of pooled scores, and those figures that its axes allow."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.reporting import page
from flexaxis.experiments.reporting import sweep_figures as figures
from flexaxis.experiments.reporting.figures import colour
from flexaxis.experiments.reporting.findings import alarms, confusion
from flexaxis.experiments.reporting.page import Shown
from flexaxis.experiments.results.columns import axis_kind
from flexaxis.experiments.results.groups import Bins
from flexaxis.experiments.results.results import Results
from flexaxis.experiments.running.axes import is_option
from flexaxis.experiments.running.files import write_text
from flexaxis.experiments.running.names import REPORT

BINS = 8  # of an axis with too many values to draw each
MANY = 24  # values of an axis that are drawn each
LINES = 300  # of the table
MAPS = 3  # heat maps
SHOWN = ("lag", "lag_bound", "t10", "std", "bias", "score", "diverged", "never_settled",
         "detection")  # fmt: skip
DRAWN = ("lag", "lag_bound", "std", "bias")

DEGRADATION = (
    "Left, where something changes: the lag, the area under the remaining error after the fault "
    "(dashed: what the Cramér–Rao bound allows). Beside it: how wrong each estimate is before the "
    "fault (root mean square, in % of nominal). What other axes there are is averaged over."
)
DETECTION = (
    "A point is one setting of an estimator that reports findings: how late it finds a fault, and "
    "how many it misses, against how often it finds one where there is none."
)
ISOLATION = "What was named (columns) where something changed (rows)."
HEAT = (
    "Lag [s] after the fault, geometric mean: the darker, the slower. White: not run, or never in "
    "range."
)


def write_report(results: Results, path: Path | None = None) -> Path:
    """Write the report of a study, by default into its folder, and return its path.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    path = path or results.folder / REPORT
    write_text(path, render(results))
    return path


def render(results: Results) -> str:
    """Return the report as HTML: one file, readable without a network."""
    bins = _bins(results)
    groups = results.grouped(_lines(results), bins=bins)
    failures = results.failures()
    content = {
        "study": results.study,
        "axes": results.axes,
        "rows": groups.first(LINES).pooled(SHOWN, results.scenario),
        "left_out": max(0, len(groups) - LINES),
        "cases": results.cases,
        "failed": len(failures),
        "failures": failures[:10],
        "figures": page.shown(figure for each in FIGURES for figure in each(results, bins)),
        "colour": colour,
        "tell": figures.short,
    }
    return page.render("reporting/templates/study.html", content)


def over_each_axis(results: Results, bins: Bins) -> Iterator[Shown]:
    """Yield lag and error over each axis of numbers."""
    values = results.values()
    for axis in (a for a in values if len(values[a]) > 1 and _is_number(values[a])):
        rows = results.pooled(["method", axis], bins=_only(bins, axis), scores=DRAWN)
        if any(row[axis] is not None for row in rows):
            yield Shown(f"Over {axis}", DEGRADATION, figures.degradation(rows, axis))


def over_pairs_of_axes(results: Results, bins: Bins) -> Iterator[Shown]:
    """Yield heat maps of the lag over two axes each."""
    values = results.values()
    # Those with the fault first: size of the fault against all else is what one asks for.
    wide = [axis for axis in values if len(values[axis]) > 1]
    wide.sort(key=lambda axis: not axis.startswith("fault"))
    for y, x in list(combinations(wide, 2))[:MAPS]:
        rows = results.pooled(["method", x, y], bins=_only(bins, x, y), scores=["lag"])
        rows = [row for row in rows if row[x] is not None and row[y] is not None]
        if any(row["changed"] and row["lag"] is not None for row in rows):
            yield Shown(f"{y} × {x}", HEAT, figures.heat_map(rows, x, y))


def what_was_found(results: Results, bins: Bins) -> Iterator[Shown]:
    """Yield delay and missed faults over false alarms, and what was named where."""
    del bins
    if found := alarms(results):
        yield Shown("Detection", DETECTION, figures.detection(found))
    if counts := confusion(results):
        yield Shown("Isolation", ISOLATION, figures.isolation(counts))


def _lines(results: Results) -> list[str]:
    """Return what a line of the table is of: the estimators of a point follow each other."""
    options = [axis for axis in results.axes if is_option(axis, tuple(results.study["estimators"]))]
    return ["base", *(a for a in results.axes if a not in options), "method", *options]


def _bins(results: Results) -> dict[str, list[float]]:
    """Return the edges of bins that hold about as many points each, for axes with many values."""
    return {
        axis: np.unique(np.quantile(seen, np.linspace(0, 1, BINS + 1))).tolist()
        for axis, seen in results.values().items()
        if len(seen) > MANY and _is_number(seen)
    }


def _only(bins: Bins, *axes: str) -> dict[str, Sequence[float]]:
    return {axis: edges for axis, edges in bins.items() if axis in axes}


def _is_number(values: Sequence[Any]) -> bool:
    return axis_kind(values) == "number"


FIGURES: Sequence[Callable[[Results, Bins], Iterator[Shown]]] = (
    over_each_axis,
    over_pairs_of_axes,
    what_was_found,
)
"""The figures of a study, in the order of the page: a new one is a function that yields it, for
what its axes allow, and its name here. It takes the edges of bins for axes with many values."""
