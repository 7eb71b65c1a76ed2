"""What charts and tables of a study are of: whom they tell apart, pooled rows, what was found."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from flexaxis.experiments.reporting.run.measures import over_bound, t10
from flexaxis.experiments.reporting.study.words import axis_words
from flexaxis.experiments.reporting.tables import Cell, Column, Row, Table, pair, scored, toned
from flexaxis.experiments.results.groups import Bins
from flexaxis.experiments.results.results import Results
from flexaxis.experiments.running.study import applies, is_option
from flexaxis.experiments.scoring.intervals import mean_interval
from flexaxis.experiments.scoring.pooling import values

FEW = 9  # that a chart tells apart: as many as there are colours
MISSED, UNMODELLED, SEVERAL = "missed", "unmodelled", "several"


def rows_of(
    results: Results, axes: Sequence[str], bins: Bins, scores: Sequence[str] | None
) -> list[dict[str, Any]]:
    """Return pooled rows over some axes, each with `who` it is of."""
    options = told_apart(results, axes)
    by = ["method", *options, *axes]
    rows = results.pooled(
        by, bins={axis: edges for axis, edges in bins.items() if axis in by}, scores=scores
    )
    return [row | {"who": who(row, options)} for row in rows]


def who(row: Mapping[str, Any], options: Iterable[str]) -> str:
    """Return the estimator of a row, with the options that are told apart.

    Examples
    --------
    >>> who({"method": "ekf", "ekf.walk": 0.5, "imm.walk": None}, ["ekf.walk", "imm.walk"])
    'ekf[walk=0.5]'
    """
    said = {key.rpartition(".")[2]: row[key] for key in options if row[key] is not None}
    method = str(row["method"])
    if not said:
        return method
    inside = ",".join(f"{name}={short(value)}" for name, value in said.items())
    name, _, given = method.partition("[")
    return f"{name}[{given.removesuffix(']')},{inside}]" if given else f"{name}[{inside}]"


def told_apart(results: Results, axes: Sequence[str] = ()) -> list[str]:
    """Return the swept options that are told apart beside some axes: all, or too many and none."""
    options = [key for key in options_of(results) if key not in axes]
    seen, count = results.values(), 0
    for method in results.study["estimators"]:
        settings = 1
        for key in options:
            settings *= max(1, len(seen[key])) if applies(key, method) else 1
        count += settings
    return options if count <= FEW else []


def pooled_over(results: Results, axes: Sequence[str] = ()) -> list[str]:
    """Return the axes that are averaged over: those that are neither drawn nor told apart."""
    apart = told_apart(results, axes)
    seen = results.values()
    return [k for k in results.axes if k not in axes and k not in apart and len(seen[k]) > 1]


def options_of(results: Results) -> list[str]:
    """Return the axes that are options of estimators."""
    estimators = tuple(results.study["estimators"])
    return [axis for axis in results.axes if is_option(axis, estimators)]


def short(value: Any) -> str:
    """Return the value of an axis for a table."""
    if value is None:
        return "–"
    return f"{value:.3g}" if isinstance(value, int | float) else str(value)


def alarms(results: Results) -> list[dict[str, Any]]:
    """Return a row for each estimator that reports findings, at each setting, over all its cases.

    ``method, estimator``; ``delay`` from a fault to the first finding, the mean over the cases that
    found one, with its 95 % ``delay_interval`` [s], None without one; ``missed``, of the faults
    [%]; ``false_per_hour``, findings outside the windows of faults in an hour of simulated time.
    """
    groups, found = results.grouped(["method", "estimator"], cases=True), []
    for i, key in enumerate(groups.keys):
        columns = groups.columns(i)
        if not values(columns, "detection.alarms").size:
            continue
        delays = values(columns, "detection.delay")
        missed, faults, false, seconds = (
            float(np.nansum(columns[name]))
            for name in (
                "detection.missed", "detection.faults", "detection.false_alarms", "seconds"
            )
        )  # fmt: skip
        found.append({
            **key,
            "delay": float(delays.mean()) if delays.size else None,
            "delay_interval": mean_interval(delays),
            "missed": 100 * missed / max(1.0, faults),
            "false_per_hour": 3600 * false / seconds,
        })  # fmt: skip
    return found


def confusion(results: Results) -> dict[str, Counter[tuple[str, str]]]:
    """Count for each method what each fault was taken for, by (fault, named)."""
    found: dict[str, Counter[tuple[str, str]]] = {}
    groups = results.grouped(["method", "isolation"], cases=True)
    for i, key in enumerate(groups.keys):
        for entry in json.loads(key["isolation"] or "[]"):
            counter = found.setdefault(key["method"], Counter())
            counter[entry["fault"], _named(entry["named"])] += len(groups.rows[i])
    return found


def _named(names: Sequence[str] | None) -> str:
    if names is None:
        return MISSED
    return names[0] if len(names) == 1 else SEVERAL if names else UNMODELLED


def isolation_table(counts: Mapping[str, Counter[tuple[str, str]]], *, words: str) -> Table:
    """Return what was named where something changed, in % of the faults, a line a method and fault.

    Parameters
    ----------
    counts : mapping of str to Counter
        As from `confusion`.
    words : str
    """
    pairs = [pair for counter in counts.values() for pair in counter]
    faults = list(dict.fromkeys(fault for fault, _ in pairs))
    others = sorted({named for _, named in pairs} - {*faults, MISSED, UNMODELLED, SEVERAL})
    named = [*faults, *others, SEVERAL, UNMODELLED, MISSED]
    lines = []
    for method, counter in counts.items():
        for fault in faults:
            number = max(1, sum(counter[fault, name] for name in named))
            shares = [100 * counter[fault, name] / number for name in named]
            told = (replace(scored(share), tone=share / 100) for share in shares)
            cells = [Cell(method), Cell(fault), *told]
            lines.append(Row(cells, who=method))
    heads = [Column("estimator", kind="text"), Column("changed", kind="text")]
    return Table("Isolation", [*heads, *(Column(f"{name} [%]") for name in named)], lines, words)


def lag_table(
    rows: Sequence[Mapping[str, Any]], axes: tuple[str, str], labels: tuple[str, str], words: str
) -> Table:
    """Return the lag over two axes: a line a value of the second and estimator.

    Parameters
    ----------
    rows : sequence of mapping
        Of the parameters that changed.
    axes, labels : (str, str)
        Swept keys across and down, and what they are called.
    words : str
    """
    found: dict[tuple[str, Any], dict[Any, list[tuple[float, int]]]] = {}
    for row in rows:
        line = found.setdefault((row["who"], row[axes[1]]), {})
        line.setdefault(row[axes[0]], []).append((row["lag"], row["runs"]))
    across = list(dict.fromkeys(row[axes[0]] for row in rows))
    means = iter(toned([_mean(line.get(x)) for line in found.values() for x in across]))
    lines = []
    for method, value in found:
        cells = [Cell(method), Cell(short(value), value), *(next(means) for _ in across)]
        lines.append(Row(cells, who=method))
    heads = [Column("estimator", kind="text"), Column(labels[1])]
    heads += [Column(f"lag [s] at {labels[0]} {short(x)}") for x in across]
    return Table(f"Lag over {labels[0]} and {labels[1]}", heads, lines, words)


def _mean(each: Sequence[tuple[float, int]] | None) -> float | None:
    """Return the mean of lags, weighted by their runs."""
    if each is None:
        return None
    lags, runs = zip(*each, strict=True)
    return float(np.average(lags, weights=runs))


LINES = 300  # of both tables
POOLED = ("lag", "lag_bound", "t10", "std", "bias", "score", "diverged", "never_settled",
         "detection")  # fmt: skip
SHOWN = (
    Column("lag [s]", term="lag"),
    Column("× bound", term="× bound"),
    Column("t10 [s]", term="t10"),
    Column("std [%]", term="std"),
    Column("bias [%]", term="bias"),
    Column("score", term="score"),
    Column("diverged", term="diverged"),
    Column("failed", more=True),
    Column("runs", more=True),
    Column("bound [s]", term="bound", more=True),
    Column("never settled", more=True),
    Column("false alarms per hour", term="false alarms", more=True),
)


NEED_A_CHANGE = ("lag [s]", "× bound", "t10 [s]", "score", "bound [s]", "never settled")
WORDS = (
    "All rows, one a parameter of each case: scores.sqlite beside this page; Results.to_csv "
    "writes them as a table."
)


def scores_tables(results: Results, bins: Bins) -> list[Table]:
    """Return the table of what changed and that of what did not; an empty one is left out.

    What has more lines than `LINES` is cut, and says so.
    """
    options = options_of(results)
    points = [axis for axis in results.axes if axis not in options]
    groups = results.grouped(["base", *points, "method", *options], bins=bins)
    several = len(results.study["scenarios"]) > 1
    axes = [*options, *points]
    first = [
        Column("estimator", kind="text"),
        *([Column("scenario", term="scenario", kind="text")] if several else []),
        *(Column(axis_words(axis, results.study)) for axis in axes),
        Column("parameter", kind="text"),
    ]
    rows = groups.first(LINES).pooled(POOLED)
    left = len(groups) - LINES
    words = (f"{left} more lines are left out. " if left > 0 else "") + WORDS
    still = [column.heading not in NEED_A_CHANGE for column in SHOWN]

    def line(row: Mapping[str, Any], kept: Sequence[bool]) -> Row:
        base = [str(row["base"])] * several
        cells = [
            *map(Cell, [str(row["method"]), *base]),
            *(Cell(short(row[axis]), "" if row[axis] is None else row[axis]) for axis in axes),
            Cell(row["parameter"]),
            *(cell for cell, there in zip(_scores(row), kept, strict=True) if there),
        ]
        return Row(cells, who=who(row, options), group="".join(base))

    found = []
    for heading, changed, kept in (
        ("What changed", True, [True] * len(SHOWN)),
        ("Parameters that did not change", False, still),
    ):
        mine = [row for row in rows if row["changed"] == changed]
        columns = [*first, *(c for c, there in zip(SHOWN, kept, strict=True) if there)]
        lines = [line(row, kept) for row in mine]
        if lines:
            found.append(Table(heading, columns, lines, words))
    return found


def _scores(row: Mapping[str, Any]) -> list[Cell]:
    """Return the cells of `SHOWN`."""
    names = ("std", "bias", "score", "diverged", "failed", "runs", "lag_bound", "never_settled")
    lag = scored(row["lag"], within=pair(row["lag_interval"]))
    alarms = pair(row["false_alarms_per_hour_interval"])
    false = scored(row["false_alarms_per_hour"], within=alarms)
    return [lag, over_bound(row), t10(row), *(scored(row[name]) for name in names), false]
