"""The charts of speed against noise: over the knob of each estimator, or as each is set."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flexaxis.experiments.reporting.charts import Array, Chart, Line, Panel
from flexaxis.experiments.scoring import ranking

Row = Mapping[str, Any]

BOUNDS = (
    ("lag_bound", "bound, all θ unknown"),
    ("lag_bound_single", "bound, only this θ unknown"),
)


def tradeoff(points: Sequence[Row], order: Sequence[str], *, name: str = "tradeoff") -> Chart:
    """Return lag over noise, a line an estimator over its knob, a panel a fault.

    Parameters
    ----------
    points : sequence of mapping
        As in `flexaxis.experiments.studies.sweep.Sweep`.
    order : sequence of str
        Estimators, the best first.
    name : str
    """
    faults = list(dict.fromkeys((p["scenario"], p["parameter"]) for p in points))
    scale = {fault: _reference_std(points, fault) for fault in faults}
    known = all(scale.values())
    panels = []
    for fault in faults:
        mine = [p for p in points if (p["scenario"], p["parameter"]) == fault]
        unit = (scale[fault] or 1.0) if known else 1.0
        lines = [line for each in order if (line := _knob(mine, each, unit))]
        title = f"{fault[0]}: {fault[1]}"
        panels.append(
            Panel(title=title, y="lag [s]", y_log=True, lines=[*lines, *_bounds(mine, lines)])
        )
    return Chart(
        name=name,
        title="Speed against noise",
        words="Nearer to the lower left is better. A line is an estimator whose knob is turned "
        "from slow and quiet to quick and noisy; whiskers are 95 % intervals over seeds. Dotted and dash-dotted: "
        "the lags that the Cramér–Rao bounds allow."
        + (" The table is read off at the vertical line; what it "
           "prints is the jackknife’s value, which takes off the bias that so few runs have, and "
           "may differ a little from the curve." if known else ""),
        x=f"std before the fault / that of {ranking.REFERENCE}" if known
        else "std before the fault [% of nominal]",
        panels=panels,
        marks=[(1.0, "equal noise")] if known else [],
        x_log=True,
    )  # fmt: skip


def _reference_std(points: Sequence[Row], fault: tuple[str, str]) -> float | None:
    """Return what the reference has at its default, by which the noise of others is measured."""
    mine = (p for p in points if (p["scenario"], p["parameter"]) == fault and p["factor"] == 1.0)
    found = next((p["std"] for p in mine if p["estimator"] == ranking.REFERENCE), None)
    return float(found) if found else None


def _knob(points: Sequence[Row], estimator: str, unit: float) -> Line | None:
    mine = [p for p in points if p["estimator"] == estimator and p["std"] and p["lag"]]
    if not mine:
        return None
    return _points(estimator, sorted(mine, key=lambda p: p["std"]), unit, kind="both")


def _points(who: str, mine: Sequence[Row], unit: float, *, kind: Any, **more: Any) -> Line:
    def ends(key: str) -> tuple[Array, Array]:
        sides = [p.get(f"{key}_interval") or (p[key], p[key]) for p in mine]
        return tuple(np.array([[math.nan if e is None else e for e in s] for s in sides]).T)

    x_low, x_high = ends("std")
    low, high = ends("lag")
    x, y = np.array([[p["std"] / unit, p["lag"]] for p in mine]).T
    sides: dict[str, Any] = {
        "x_low": x_low / unit,
        "x_high": x_high / unit,
        "low": low,
        "high": high,
    }
    return Line(who=who, x=x, y=y, kind=kind, **sides, **more)


def _bounds(points: Sequence[Row], lines: Sequence[Line]) -> list[Line]:
    """Return the bounds as horizontal lines over what is drawn."""
    ends = np.array([[line.x.min(), line.x.max()] for line in lines] or [[0.1, 10.0]])
    x = np.array([ends[:, 0].min(), ends[:, 1].max()])
    found = []
    for key, label in BOUNDS:
        bound = next((p[key] for p in points if p.get(key)), None)
        if bound:
            found.append(Line(x=x, y=np.full(2, bound), role="bound", label=label))
    return found


def as_set(rows: Sequence[Row], order: Sequence[str], *, name: str = "tradeoff") -> Chart | None:
    """Return lag over noise at the one setting that each was run at, a point a fault.

    Parameters
    ----------
    rows : sequence of mapping
        Pooled rows; those without a lag are left out.
    order : sequence of str
    name : str
    """
    mine = [r for r in rows if r["changed"] and r["lag"] is not None and r["std"]]
    lines = [
        _points(who, own, 1.0, kind="points")
        for who in order
        if (own := [r for r in mine if r["estimator"] == who])
    ]
    if not lines:
        return None
    return Chart(
        name=name,
        title="Speed against noise",
        words="Nearer to the lower left is better; a point is an estimator as it is set, on one "
        "fault. `flexaxis tradeoff` draws the whole curve of each knob, with the bounds. Whiskers "
        "are 95 % intervals over seeds.",
        x="std before the fault [% of nominal]",
        panels=[Panel(y="lag [s]", y_log=True, lines=lines)],
        x_log=True,
    )
