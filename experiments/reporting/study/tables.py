"""The tables of a study: a line an estimator, point and parameter, with all pooled scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flexaxis.experiments.reporting.study import rows as study_rows
from flexaxis.experiments.reporting.study.axis_words import axis_words
from flexaxis.experiments.reporting.study.charts import short
from flexaxis.experiments.reporting.tables import Cell, Column, Row, Table, pair, scored, settled
from flexaxis.experiments.results.groups import Bins
from flexaxis.experiments.results.results import Results

LINES = 300  # of both tables
SHOWN = ("lag", "lag_bound", "t10", "std", "bias", "score", "diverged", "never_settled",
         "detection")  # fmt: skip
SCORES = (
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
    "All rows, one a parameter of each case: the .jsonl files beside this page; flexaxis export "
    "writes them as a table."
)


def scores_tables(results: Results, bins: Bins) -> list[Table]:
    """Return the table of what changed and that of what did not; an empty one is left out.

    What has more lines than `LINES` is cut, and says so.
    """
    options = study_rows.options_of(results)
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
    rows = groups.first(LINES).pooled(SHOWN)
    left = len(groups) - LINES
    words = (f"{left} more lines are left out. " if left > 0 else "") + WORDS
    still = [column.heading not in NEED_A_CHANGE for column in SCORES]
    found = []
    for heading, changed, kept in (
        ("What changed", True, [True] * len(SCORES)),
        ("Parameters that did not change", False, still),
    ):
        mine = [row for row in rows if row["changed"] == changed]
        columns = [*first, *(c for c, there in zip(SCORES, kept, strict=True) if there)]
        lines = [_line(row, axes, options, kept, several=several) for row in mine]
        if lines:
            found.append(Table(heading, columns, lines, words))
    return found


def _line(
    row: Mapping[str, Any],
    axes: Sequence[str],
    options: Sequence[str],
    kept: Sequence[bool],
    *,
    several: bool,
) -> Row:
    cells = [
        Cell(str(row["method"])),
        *([Cell(str(row["base"]))] if several else []),
        *(Cell(short(row[axis]), "" if row[axis] is None else row[axis]) for axis in axes),
        Cell(row["parameter"]),
        *(cell for cell, there in zip(_scores(row), kept, strict=True) if there),
    ]
    group = str(row["base"]) if several else ""
    return Row(cells, who=study_rows.who(row, options), group=group)


def _scores(row: Mapping[str, Any]) -> list[Cell]:
    """Return the cells of `SCORES`."""
    over = row["lag"] / row["lag_bound"] if row["lag"] is not None and row["lag_bound"] else None
    lag, t10 = scored(row["lag"], within=pair(row["lag_interval"])), row["t10"]
    settled_ = Cell(settled(t10, row["changed"]), "" if t10 is None else t10)
    names = ("std", "bias", "score", "diverged", "failed", "runs", "lag_bound", "never_settled")
    alarms = pair(row["false_alarms_per_hour_interval"])
    false = scored(row["false_alarms_per_hour"], within=alarms)
    return [lag, scored(over), settled_, *(scored(row[name]) for name in names), false]
