"""The charts of a run over time: every estimator on a scenario, whole and at the fault."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.reporting.charts import Chart, Line, Panel
from flexaxis.experiments.scoring.curves import CURVE_STEP, Curve, near_fault
from flexaxis.experiments.scoring.parameter_names import nominal_theta, physical, theta_over_time
from flexaxis.experiments.scoring.windows import WINDOW
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.floating]

BEFORE, BANDS = 1.0, 5  # s before a fault that the first picture shows; estimators with a band
OPENS = " A click on a curve opens the median run of its estimator."
RAMP = 600  # changes of the truth from which on every tenth sample of it will do


def at_a_fault(curves: Sequence[Curve], scenario: Scenario) -> Chart | None:
    """Return what one would draw on a board: a parameter that changes, and who follows how.

    Parameters
    ----------
    curves : sequence of Curve
        Those of the scenario to be drawn, the best first.
    scenario : Scenario

    Returns
    -------
    Chart or None
        None where nothing changes that is estimated.
    """
    events = scenario.events()
    whole = trajectories(curves, scenario, name="at-a-fault")
    names = {e.parameter for e in events[:1]}
    panels = [p for p in whole.panels if physical(p.y.partition(" / ")[0])[0] in names]
    if not panels:
        return None
    at = events[0].index * scenario.period
    window = ("", max(0.0, at - BEFORE), min(scenario.duration, at + WINDOW))
    return replace(
        whole,
        title=f"At the fault: {scenario.name}",
        words="Median and 10–90 % of the runs, as the estimators are set; truth dashed.",
        panels=panels[:1],
        windows=[window],
    )


def trajectories(
    curves: Sequence[Curve],
    scenario: Scenario,
    *,
    name: str,
    picks: Mapping[str, str] = MappingProxyType({}),
) -> Chart:
    """Return the estimates of all estimators over time on one scenario, a panel a parameter.

    Parameters
    ----------
    curves : sequence of Curve
        Those of the scenario.
    scenario : Scenario
    name : str
        Of its place in the page.
    picks : mapping of str to str, optional
        What a click on the curve of an estimator opens.
    """
    banded = {curve.estimator for curve in curves[:BANDS]}
    changed = {event.parameter for event in scenario.events()}
    panels = []
    names = dict.fromkeys(n for curve in curves for n in curve.names)
    for parameter in sorted(names, key=lambda name: physical(name)[0] not in changed):
        mine = [c for c in curves if parameter in c.names]
        lines = [_line(c, parameter, c.estimator in banded, picks) for c in mine]
        lines.insert(0, truth_line(scenario, parameter))
        panels.append(Panel(y=f"{parameter} / nominal", lines=lines))
    return Chart(
        name=name,
        title=f"Estimates over time on {scenario.name}",
        words=_words(scenario) + OPENS * bool(picks),
        x="time [s]",
        panels=panels,
        **around(scenario),
    )


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


def truth_line(scenario: Scenario, parameter: str) -> Line:
    """Return the true value of a parameter over nominal, as steps where it changes."""
    values = theta_over_time(scenario, [parameter])[:, 0] / nominal_theta(scenario, [parameter])[0]
    change = np.flatnonzero(np.diff(values)) + 1
    if len(change) > RAMP:
        change = np.arange(CURVE_STEP, len(values), CURVE_STEP)
    kept = np.unique(np.r_[0, change, len(values) - 1])
    x, y = scenario.times[kept], values[kept]
    return Line(x=x, y=y, kind="steps", role="truth", label="truth")


def spliced(whole: Sequence[Array], near: Sequence[Array] | None = None) -> Any:
    """Return curves, time first, with those of another in the time that this has."""
    if near is None or not len(near[0]):
        return tuple(whole)
    before, behind = whole[0] < near[0][0], whole[0] > near[0][-1]
    return tuple(
        np.concatenate([w[before], n, w[behind]]) for w, n in zip(whole, near, strict=True)
    )


def _line(curve: Curve, parameter: str, band: bool, picks: Mapping[str, str]) -> Line:
    """Return a parameter over time: about the fault in every sample."""
    i = curve.names.index(parameter)
    parts = [(c.time, c.low[:, i], c.median[:, i], c.high[:, i]) for c in (curve, curve.near) if c]
    time, low, median, high = spliced(*parts)
    found = Line(who=curve.estimator, x=time, y=median, pick=picks.get(curve.estimator, ""))
    return replace(found, low=low, high=high) if band else found
