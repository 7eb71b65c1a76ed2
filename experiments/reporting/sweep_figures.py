"""Lags of a study drawn with matplotlib, for a notebook; a report has `sweep_charts`.

A line is a method, in its colour; whiskers are 95 % intervals over the cases behind a point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from flexaxis.experiments.reporting.figures import colour, symbol

Row = Mapping[str, Any]
_DASHES = ("-", ":", "-.", (0, (5, 1)))


def draw_lags(ax: Axes, rows: Sequence[Row], axis: str) -> None:
    """Draw the lag after the fault over the values of an axis, and its bound."""
    names = list(dict.fromkeys(row["parameter"] for row in rows))
    for name, dashes in zip(names, _DASHES * len(names), strict=False):
        mine = [row for row in rows if row["parameter"] == name]
        _lines(ax, mine, axis, "lag", dashes, f" ({symbol(name)})" if len(names) > 1 else "")
        bounds = {row[axis]: row["lag_bound"] for row in mine if row["lag_bound"] is not None}
        if bounds:
            label = "Cramér–Rao bound" if name == names[0] else None
            ax.plot(*zip(*sorted(bounds.items()), strict=True), "k--", lw=1.0, label=label)
    ax.set_ylabel("lag after [s]")


def _lines(  # noqa: PLR0917
    ax: Axes, rows: Sequence[Row], axis: str, measure: str, dashes: Any = "-", suffix: str = ""
) -> None:
    """Draw a line a method, with the intervals that stand beside a column."""
    for method in dict.fromkeys(row["method"] for row in rows):
        mine = [row for row in rows if row["method"] == method]
        mine.sort(key=lambda row: row[axis])
        y = np.array([row[measure] for row in mine], float)
        x, whiskers = [row[axis] for row in mine], _whiskers(mine, y, f"{measure}_interval")
        ax.errorbar(
            x, y, yerr=whiskers, color=colour(method), ls=dashes, marker="o", markersize=4,
            capsize=2, lw=1.3, label=method + suffix,
        )  # fmt: skip


def _whiskers(rows: Sequence[Row], values: Any, column: str) -> Any:
    """Return how far the intervals reach below and above some values (2, n)."""
    spans = [row.get(column) or (v, v) for v, row in zip(values, rows, strict=True)]
    return np.abs(np.reshape(spans, (-1, 2)).T - values)
