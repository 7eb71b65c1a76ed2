"""The charts of a run over time: every estimator on a scenario, whole and at the fault."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.reporting.charts import Chart, Line, Panel
from flexaxis.experiments.reporting.run_budget import FULL, Thinning
from flexaxis.experiments.scoring.curves import CURVE_STEP, Curve, near_fault
from flexaxis.experiments.scoring.theta import nominal_theta, physical, theta_over_time
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.floating]

PANEL = 500  # steps to which a panel's height is rounded: a screen draws some 200 points of it
RAMP = 600  # changes of the truth from which on every tenth sample of it will do


def trajectories(
    curves: Sequence[Curve], scenario: Scenario, thinning: Thinning = FULL, *, name: str
) -> Chart:
    """Return the estimates of all estimators over time on one scenario, a panel a parameter.

    Parameters
    ----------
    curves : sequence of Curve
        Those of the scenario; the first nine set what is shown of the axes.
    scenario : Scenario
    thinning : Thinning
        What is left out of the later ones.
    name : str
        Of its place in the page.
    """
    panels = []
    kept = [
        curve if i < thinning.near else replace(curve, near=None)
        for i, curve in enumerate(curves[: thinning.drawn])
    ]
    bands = {curve.estimator for curve in kept[: thinning.bands]}
    changed = {event.parameter for event in scenario.events()}
    names = dict.fromkeys(n for curve in kept for n in curve.names)
    for parameter in sorted(names, key=lambda name: physical(name)[0] not in changed):
        mine = [c for c in kept if parameter in c.names]
        shown = limits([_part(c, parameter) for c in mine[:9]], truth(scenario, parameter)[1])
        lines = [_line(c, parameter, shown, band=c.estimator in bands) for c in mine]
        panels.append(_panel(parameter, [truth_line(scenario, parameter), *lines], shown))
    return Chart(
        name=name,
        title=f"Estimates over time on {scenario.name}",
        words=_words(scenario),
        x="time [s]",
        panels=panels,
        **around(scenario),
    )


def opening(chart: Chart, names: Mapping[str, str]) -> Chart:
    """Return a chart whose curves open something, by estimator; without any, as it is."""
    if not names:
        return chart
    panels = [
        replace(p, lines=[replace(line, pick=names.get(line.who, "")) for line in p.lines])
        for p in chart.panels
    ]
    words = f"{chart.words} A click on a curve opens the median run of its estimator."
    return replace(chart, panels=panels, words=words)


def _panel(parameter: str, lines: Sequence[Line], shown: tuple[float, float]) -> Panel:
    return Panel(y=f"{parameter} / nominal", lines=lines, y_range=shown)


def _words(scenario: Scenario) -> str:
    shaded = ["burn-in"] if scenario.burn_in else []
    shaded += ["no excitation"] if not scenario.excited().all() else []
    said = f"; shaded: {' and '.join(shaded)}" if shaded else ""
    return f"Median and 10–90 % of the runs; truth dashed{said}."


def around(scenario: Scenario) -> dict[str, Any]:
    """Return what a chart over the time of a scenario marks: faults, spans, and its windows."""
    times, part = scenario.times, near_fault(scenario)
    spans = [(0.0, scenario.burn_in, "burn-in")] if scenario.burn_in else []
    still = np.flatnonzero(np.diff(np.r_[1, scenario.excited(), 1]))
    for begin, end in zip(still[::2], still[1::2], strict=True):
        spans.append((begin * scenario.period, end * scenario.period, "no excitation"))
    windows = [("whole run", 0.0, scenario.duration)]
    if part.stop > part.start + 1:
        windows.insert(0, ("at the fault", float(times[part][0]), float(times[part][-1])))
    marks = [(e.index * scenario.period, f"{e.parameter} changes") for e in _first(scenario)]
    return {"marks": marks, "spans": spans, "windows": windows}


def _first(scenario: Scenario) -> list[Any]:
    """Return the events to mark: of a change over many samples the first of each parameter."""
    events = scenario.events()
    return list(events if len(events) <= 20 else {e.parameter: e for e in events[::-1]}.values())


def truth(scenario: Scenario, parameter: str) -> tuple[Array, Array]:
    """Return time and value over nominal where the truth changes, and its ends."""
    values = theta_over_time(scenario, [parameter])[:, 0] / nominal_theta(scenario, [parameter])[0]
    change = np.flatnonzero(np.diff(values)) + 1
    if len(change) > RAMP:
        change = np.arange(CURVE_STEP, len(values), CURVE_STEP)
    kept = np.unique(np.r_[0, change, len(values) - 1])
    return scenario.times[kept], values[kept]


def truth_line(scenario: Scenario, parameter: str) -> Line:
    """Return the true value of a parameter over nominal, as steps."""
    x, y = truth(scenario, parameter)
    return Line(x=x, y=y, kind="steps", role="truth", label="truth")


def _part(curve: Curve, parameter: str) -> tuple[Array, Array, Array, Array]:
    """Return time, low, median and high (M,) of a parameter: about the fault every sample."""
    i = curve.names.index(parameter)
    sides = [(curve.time, curve.low[:, i], curve.median[:, i], curve.high[:, i])]
    if curve.near is not None:
        near = curve.near
        sides.append((near.time, near.low[:, i], near.median[:, i], near.high[:, i]))
    return spliced(*sides)


def spliced(whole: Sequence[Array], near: Sequence[Array] | None = None) -> Any:
    """Return curves, time first, with those of another in the time that this has."""
    if near is None or not len(near[0]):
        return tuple(whole)
    before, behind = whole[0] < near[0][0], whole[0] > near[0][-1]
    return tuple(
        np.concatenate([w[before], n, w[behind]]) for w, n in zip(whole, near, strict=True)
    )


def _line(curve: Curve, parameter: str, shown: tuple[float, float], *, band: bool) -> Line:
    time, low, median, high = _part(curve, parameter)
    if not band:
        return Line(who=curve.estimator, x=time, y=rounded(median, shown))
    return Line(
        who=curve.estimator,
        x=time,
        y=rounded(median, shown),
        low=rounded(low, shown),
        high=rounded(high, shown),
    )


def rounded(values: Array, shown: tuple[float, float]) -> Array:
    """Return values rounded to two fifths of a point of a panel; far outside of it, at its edge.

    Noise that no screen can show would be most of the page.

    Parameters
    ----------
    values : ndarray (M,)
    shown : (float, float)
        What a panel shows.
    """
    low, high = shown
    step = (high - low) / PANEL
    with np.errstate(invalid="ignore"):
        kept = np.clip(values, low - (high - low), high + (high - low))
    return np.rint((kept - low) / step) * step + low


def limits(parts: Iterable[Sequence[Array]], truths: Array) -> tuple[float, float]:
    """Return what to show: the truth and what lies near it, at most twice its range away.

    Parameters
    ----------
    parts : iterable of sequence of ndarray
        Time and curves of each estimator.
    truths : ndarray
        True values over nominal.
    """
    drawn = np.concatenate([side for part in parts for side in part[1:]] or [np.empty(0)])
    drawn = drawn[np.isfinite(drawn)]
    low, high = min(1.0, truths.min()), max(1.0, truths.max())
    # Most of what is drawn, but a burst or a run at its bound may not set the scale.
    room = max(high - low, 0.04)
    if drawn.size:
        low = max(min(low, float(np.percentile(drawn, 0.5))), low - 2 * room)
        high = min(max(high, float(np.percentile(drawn, 99.5))), high + 2 * room)
    margin = 0.08 * (high - low) + 0.005
    return low - margin, high + margin
