"""The HTML report of a study: a sentence, a table of pooled scores, the charts its axes allow."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.files import REPORT, write_text
from flexaxis.experiments.reporting import page
from flexaxis.experiments.reporting.charts import Chart
from flexaxis.experiments.reporting.old_results import Bins, Results, axis_kind
from flexaxis.experiments.reporting.study import charts
from flexaxis.experiments.reporting.study import rows as study_rows
from flexaxis.experiments.reporting.study.rows import (
    alarms,
    confusion,
    isolation_table,
    lag_table,
    scores_tables,
)
from flexaxis.experiments.reporting.study.words import axis_words
from flexaxis.experiments.reporting.tables import Table, number, pair
from flexaxis.experiments.reporting.terminal import failures_in_words
from flexaxis.experiments.studies.finds import PER_HOUR, Finds, finds

BINS = 8  # of an axis with too many values to draw each
MANY = 24  # values of an axis that are drawn each
MAPS = 3  # tables over two axes
TOLD = 3  # estimators in the sentence
DRAWN = ("lag", "lag_bound", "std", "bias")

DEGRADATION = (
    "Where something changes: the lag, the area under the remaining error after the fault (dotted: "
    "what the Cramér–Rao bound allows); and how wrong each estimate is before the fault (root mean "
    "square, in % of nominal). "
)
DETECTION = (
    "A point is one setting of an estimator that reports findings: how late it finds a fault, and "
    "how many it misses, against how often it finds one where there is none."
)
ISOLATION = "What was named (columns) where something changed (lines), in % of the faults."
FINDS = (
    "Share of the faults found within 1 s. A find names what changed, or is one that the same run "
    "without the fault, its twin, does not show; at 1 stands what is found in twins, by chance. "
)
OVER_TWO = "Lag after the fault, geometric mean; –: not run, or never in range. "
WHISKERS = (
    " Whiskers are 95 % intervals over the seeds behind a point, where values of other keys are "
    "averaged over about the mean of each; runs that were lost are in none of them, but counted in "
    "the table."
)


def write_report(results: Results, path: Path | None = None) -> Path:
    """Write the report of a study, by default into its folder, and return its path.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    path = path or (results.folder or Path()) / REPORT
    write_text(path, render(results))
    return path


def render(results: Results) -> str:
    """Return the report as HTML: one file, readable without a network."""
    bins = _bins(results)
    failed = results.failed()
    content = {
        "study": results.study,
        "axes": [_words(results, axis) for axis in results.axes],
        "finding": finding(results),
        "tables": scores_tables(results, bins),
        "cases": results.cases,
        "failed": len(failed),
        "failures": failures_in_words(failed[:10]),
        "charts": [chart for each in CHARTS for chart in each(results, bins)],
        "further": [table for each in TABLES for table in each(results, bins)],
    }
    return page.render("reporting/templates/study.html", content)


def what_is_found(results: Results, bins: Bins) -> Iterator[Chart]:
    """Yield the share of faults found over their size, where there are twins."""
    del bins
    found = finds(results)
    for axis in dict.fromkeys(each.axis for each in found):
        mine = [each for each in found if each.axis == axis]
        told = {(each.base, each.estimator): _false_alarms(each) for each in mine}
        words = FINDS + _averaged(results, [axis]) + " False alarms in the twins: "
        yield charts.finds(
            mine, label=_words(results, axis), words=f"{words}{'; '.join(told.values())}."
        )


def _false_alarms(each: Finds) -> str:
    """Return the rate of false alarms of an estimator, with exposure and limits."""
    low, high = each.per_hour_interval
    within = f"{low:.3g} … {high:.3g}" if each.alarms else f"at most {high:.3g}"
    how = "" if each.threshold is None else f", a threshold on its estimates for {PER_HOUR:g}"
    return f"{each.estimator} {each.alarms} in {each.hours:.2g} h ({within} an hour{how})"


def over_each_axis(results: Results, bins: Bins) -> Iterator[Chart]:
    """Yield lag and error over each axis of numbers."""
    values = results.values()
    for axis in (a for a in values if len(values[a]) > 1 and _is_number(values[a])):
        rows = study_rows.rows_of(results, [axis], bins, DRAWN)
        if any(row[axis] is not None for row in rows):
            words = DEGRADATION + _averaged(results, [axis]) + WHISKERS
            label = _words(results, axis)
            yield charts.degradation(rows, axis, label=label, words=words)


def over_pairs_of_axes(results: Results, bins: Bins) -> Iterator[Table]:
    """Yield tables of the lag over two axes each."""
    values = results.values()
    # Those with the fault first: size of the fault against all else is what one asks for.
    wide = [axis for axis in values if len(values[axis]) > 1]
    wide.sort(key=lambda axis: not axis.startswith("fault"))
    for y, x in list(combinations(wide, 2))[:MAPS]:
        rows = study_rows.rows_of(results, [x, y], bins, ["lag"])
        rows = [row for row in rows if row[x] is not None and row[y] is not None]
        rows = [row for row in rows if row["changed"] and row["lag"] is not None]
        if rows:
            labels = _words(results, x), _words(results, y)
            words = OVER_TWO + _averaged(results, [x, y])
            yield lag_table(rows, (x, y), labels, words)


def what_was_found(results: Results, bins: Bins) -> Iterator[Chart]:
    """Yield delay and missed faults over false alarms."""
    del bins
    if found := alarms(results):
        yield charts.detection(found, words=DETECTION + WHISKERS)


def what_it_was_taken_for(results: Results, bins: Bins) -> Iterator[Table]:
    """Yield what was named where something changed."""
    del bins
    if counts := confusion(results):
        yield isolation_table(counts, words=ISOLATION)


def finding(results: Results) -> str:
    """Return the sentence: pooled over all points, as the estimators are set."""
    rows = study_rows.rows_of(results, [], {}, ("lag", "std", "bias", "diverged"))
    lags = [row for row in rows if row["changed"] and row["lag"] is not None]
    if lags:
        names = dict.fromkeys(row["parameter"] for row in lags)
        text = ". ".join(_soonest([r for r in lags if r["parameter"] == n], n) for n in names)
    elif rows:
        text = _surest(rows)
    else:
        return "No case could be run."
    lost = max((row["diverged"] for row in rows), default=0)
    more = f" Of the runs of one estimator up to {lost} were lost." if lost else ""
    return f"{text}.{more}"


def _soonest(rows: Sequence[Mapping[str, Any]], name: str) -> str:
    """Return who follows a change of a parameter soonest, in words."""
    ordered = sorted(rows, key=lambda row: row["lag"])
    told = [
        f"{row['who']} {number(row['lag'], 2)} s ({pair(row['lag_interval'])})"
        if row["lag_interval"]
        else f"{row['who']} {number(row['lag'], 2)} s"
        for row in ordered[:TOLD]
    ]
    rest = f" and {len(ordered) - TOLD} more" if len(ordered) > TOLD else ""
    return (
        f"Lag after a change of {name} over all points, as set and not at equal noise: "
        f"{', '.join(told)}{rest}"
    )


def _surest(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the error of each where nothing changes, the least first, in words."""
    errors = {
        (row["who"], row["parameter"]): (row["std"] ** 2 + (row["bias"] or 0.0) ** 2) ** 0.5
        for row in rows
        if row["std"] is not None
    }
    names = dict.fromkeys(name for _, name in errors)
    parts = []
    for name in names:
        least, who = min((error, who) for (who, other), error in errors.items() if other == name)
        parts.append(f"{name} {number(least, 2)} % by {who}")
    return f"Least error over all points, root mean square: {', '.join(parts)}"


def _averaged(results: Results, axes: Sequence[str]) -> str:
    """Return what a chart over some axes averages over, as a sentence."""
    rest = [_words(results, axis) for axis in study_rows.pooled_over(results, axes)]
    return f"Averaged over {' and '.join(rest)}." if rest else ""


def _words(results: Results, axis: str) -> str:
    return axis_words(axis, results.study)


def _bins(results: Results) -> dict[str, list[float]]:
    """Return the edges of bins that hold about as many points each, for axes with many values."""
    return {
        axis: np.unique(np.quantile(seen, np.linspace(0, 1, BINS + 1))).tolist()
        for axis, seen in results.values().items()
        if len(seen) > MANY and _is_number(seen)
    }


def _is_number(values: Sequence[Any]) -> bool:
    return axis_kind(values) == "number"


CHARTS: Sequence[Callable[[Results, Bins], Iterator[Chart]]] = (
    what_is_found,
    over_each_axis,
    what_was_found,
)
"""The charts of a study, in the order of the page: a new one is a function that yields it, for
what its axes allow, and its name here. It takes the edges of bins for axes with many values."""

TABLES: Sequence[Callable[[Results, Bins], Iterator[Table]]] = (
    over_pairs_of_axes,
    what_it_was_taken_for,
)
"""The same of tables behind the charts."""
