"""Charts of a study: scores over its axes, and what was found.

Rows are those of `Results.pooled`, each with a `who`: the estimator, with the options that are
swept of it where they are told apart. Whiskers are 95 % intervals over the cases behind a point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.reporting.charts import Chart, Line, Panel, ends
from flexaxis.experiments.studies.finds import Finds

Row = Mapping[str, Any]
Array = NDArray[np.float64]
BOUND = "Cramér–Rao bound, all θ unknown"
WIDE = 30  # ratio of ends from which on a scale is logarithmic


def degradation(rows: Sequence[Row], axis: str, *, label: str, words: str = "") -> Chart:
    """Return the lag after a fault, and the error before it, over the values of an axis.

    Parameters
    ----------
    rows : sequence of mapping
    axis, label : str
        The swept key, and what it is called.
    words : str
    """
    rows = [row for row in rows if row[axis] is not None]  # it may be an option of one method only
    names = list(dict.fromkeys(row["parameter"] for row in rows))
    lags = [row for row in rows if row["changed"] and row["lag"] is not None]
    panels = [_lags([r for r in lags if r["parameter"] == name], name, axis) for name in names]
    panels += [_errors([r for r in rows if r["parameter"] == name], name, axis) for name in names]
    across = np.array([row[axis] for row in rows], float)
    return Chart(
        title=f"Lag and error over {label}",
        words=words,
        x=label,
        panels=[panel for panel in panels if panel.lines],
        x_log=wide(across),
        name=f"over-{axis}",
    )


def wide(values: Array) -> bool:
    """Return whether values want a logarithmic scale."""
    there = values[np.isfinite(values)]
    return bool(there.size and there.min() > 0 and there.max() > WIDE * there.min())


def _lags(rows: Sequence[Row], name: str, axis: str) -> Panel:
    """Return the lag of a parameter that changes, with its bound."""
    lines = _lines(rows, axis, "lag")
    bound = {row[axis]: row["lag_bound"] for row in rows if row["lag_bound"] is not None}
    if bound:
        x, y = (np.array(side, float) for side in zip(*sorted(bound.items()), strict=True))
        lines.append(Line(x=x, y=y, role="bound", label=BOUND))
    return Panel(y=f"lag of {name} [s]", lines=lines, y_range=_from_nothing(lines))


def _errors(rows: Sequence[Row], name: str, axis: str) -> Panel:
    lines = _lines(_root_mean_squares(rows, axis), axis, "rms")
    return Panel(y=f"error of {name} [%]", lines=lines, y_range=_from_nothing(lines))


def _lines(rows: Sequence[Row], axis: str, measure: str) -> list[Line]:
    """Return a line of each, with the intervals that stand beside a column."""
    found = []
    for who in dict.fromkeys(row["who"] for row in rows):
        mine = sorted((row for row in rows if row["who"] == who), key=lambda row: row[axis])
        x, y = (np.array([row[key] for row in mine], float) for key in (axis, measure))
        low, high = ends(mine, measure)
        found.append(Line(who=who, kind="both", x=x, y=y, low=low, high=high))
    return found


def _from_nothing(lines: Sequence[Line]) -> tuple[float, float] | None:
    """Return a range that begins at 0 and has all that is drawn."""
    sides = [side for line in lines for side in (line.y, line.high) if side is not None]
    top = np.nanmax(np.concatenate([*sides, [0.0]]))
    return (0.0, 1.08 * float(top)) if np.isfinite(top) and top > 0 else None


def _root_mean_squares(rows: Sequence[Row], axis: str) -> list[dict[str, Any]]:
    """Return the rms error by line and value: over all cases, with a change later or without."""
    held: dict[tuple[str, Any], list[tuple[float, int]]] = {}
    for row in rows:
        if row["std"] is not None:
            square = row["std"] ** 2 + (row["bias"] or 0.0) ** 2
            held.setdefault((row["who"], row[axis]), []).append((square, row["runs"]))
    found = []
    for (who, value), squares in held.items():
        values, weights = zip(*squares, strict=True)
        rms = float(np.sqrt(np.average(values, weights=weights)))
        found.append({"who": who, axis: value, "rms": rms})
    return found


def finds(found: Sequence[Finds], *, label: str, words: str) -> Chart:
    """Return the share of faults found over their size, a panel a scenario and parameter.

    Parameters
    ----------
    found : sequence of Finds
        From `flexaxis.experiments.studies.finds.finds`, of one axis.
    label : str
        What the size is called.
    words : str
    """
    panels = []
    for base, parameter in dict.fromkeys((each.base, each.parameter) for each in found):
        mine = [each for each in found if (each.base, each.parameter) == (base, parameter)]
        rows = [
            {"who": each.estimator, "size": each.size, "share": 100 * each.share,
             "share_interval": [100 * end for end in each.share_interval]}
            for each in mine
        ]  # fmt: skip
        lines = _lines(rows, "size", "share")
        panels.append(Panel(y=f"{base}: {parameter} found [%]", lines=lines, y_range=(-3, 103)))
    return Chart(title="Faults found", words=words, x=label, panels=panels, name="finds")


def detection(found: Sequence[Row], *, words: str) -> Chart:
    """Return the delay of detection, and the share of faults missed, against false alarms.

    Parameters
    ----------
    found : sequence of mapping
        From `flexaxis.experiments.reporting.study.rows.alarms`: a point a setting, a line a
        method.
    words : str
    """
    delays, missed = [], []
    for method in dict.fromkeys(each["method"] for each in found):
        mine = [each for each in found if each["method"] == method]
        mine.sort(key=lambda each: each["false_per_hour"])
        delays += _settings(method, [e for e in mine if e["delay"] is not None], "delay")
        missed += _settings(method, mine, "missed")
    return Chart(
        title="Detection",
        words=words,
        x="false alarms in an hour",
        panels=[
            Panel(y="delay of detection [s]", lines=delays, y_range=_from_nothing(delays)),
            Panel(y="faults missed [%]", lines=missed, y_range=(-3, 103)),
        ],
    )


def _settings(method: str, found: Sequence[Row], measure: str) -> list[Line]:
    """Return a line through the settings of a method, and a point of each, which says its own."""
    x, y = (np.array([e[name] for e in found], float) for name in ("false_per_hour", measure))
    low, high = ends(found, measure)
    points = [
        Line(
            who=method,
            label=each["estimator"],
            kind="points",
            x=x[[i]],
            y=y[[i]],
            low=low[[i]],
            high=high[[i]],
        )
        for i, each in enumerate(found)
    ]
    return [Line(who=method, x=x, y=y), *points]
