"""Scores of one case: one estimator on one record against the true parameters.

A case gives one `Row` per estimated parameter. Errors θ̃ = θ̂ − θ_true are in per cent of nominal
before and beside a fault, and after it in units of the size D = |θ_after − θ_before| of the
fault. docs/scores.md has the definitions in words.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.theta import physical, started_nominal, true_theta
from flexaxis.sim.events import Event
from flexaxis.sim.parameters import PARAMETER_NAMES
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

WINDOW = 5.0  # s scored after a fault, unless another event comes first
QUIET = 5.0  # s of excitation before the first onset in which std and bias are taken
QUIET_WITHOUT_FAULT = 10.0  # s at the end, where there is no fault
AT_BOUND = 1.0  # s at a bound that make a run diverged


@dataclass(frozen=True)
class Window:
    """The samples `start` … `stop`−1 that are scored after the change of one parameter.

    `size` is D, the size of the fault in the unit of the estimated parameter.
    """

    parameter: str
    start: int
    stop: int
    size: float


@dataclass(frozen=True)
class Row:
    """Scores of one parameter in one case; None is "not defined here"."""

    parameter: str
    changed: bool
    lag: float | None
    t10: float | None
    std: float | None
    bias: float | None
    cross_talk: float | None
    diverged: bool
    never_settled: bool | None


def windows(scenario: Scenario, names: Sequence[str]) -> list[Window]:
    """Return the scored window of each event, in the order of time.

    The clock starts with the fault, or where nothing is excited then (a pause) when the
    excitation returns; it stops after 5 s, at the next event, or with the record. An event of a
    parameter that is not estimated has a window too, of size NaN: the others must stay put in it.
    """
    excited = scenario.excited()
    events = scenario.events()
    found = []
    for event in events:
        moving = np.flatnonzero(excited[event.index :])
        start = event.index + (int(moving[0]) if moving.size else 0)
        # Several parameters that change in the same sample are one event in time.
        later = [e.index for e in events if e.index > event.index]
        stop = min(start + round(WINDOW / scenario.period), *later, scenario.samples)
        found.append(Window(event.parameter, start, max(stop, start), _size(event, names)))
    return found


def _size(event: Event, names: Sequence[str]) -> float:
    for name in names:
        parameter, exponent = physical(name)
        if parameter == event.parameter:
            return abs(event.after**exponent - event.before**exponent)
    return np.nan


def quiet(scenario: Scenario) -> NDArray[np.intp]:
    """Return the samples on which std and bias are taken.

    They are the last 5 s before the first onset in which the excitation is on, after burn-in;
    without a fault the last 10 s, or the last half of a shorter run.
    """
    events = scenario.events()
    if not events:
        half = scenario.samples // 2
        length = min(round(QUIET_WITHOUT_FAULT / scenario.period), half)
        return np.arange(scenario.samples - length, scenario.samples)
    burnt = round(scenario.burn_in / scenario.period)
    usable = np.flatnonzero(scenario.excited()[: events[0].index])
    return usable[usable >= burnt][-round(QUIET / scenario.period) :]


def score(
    scenario: Scenario,
    names: Sequence[str],
    theta: Array,
    true_parameters: Array,
    bounds: tuple[Array, Array] | None = None,
) -> list[Row]:
    """Score a run of estimates against the truth.

    Parameters
    ----------
    scenario : Scenario
        What was run.
    names : sequence of str
        Estimated parameters, such as ``("k_T", "1/J_a", "f_m")``.
    theta : ndarray (N, p)
        Estimates θ[k], made from y[0..k].
    true_parameters : ndarray (N, 12)
        True physical parameters.
    bounds : (lower, upper), each ndarray (p,), optional
        Box of the estimator; more than 1 s on its edge is counted as diverged.

    Returns
    -------
    list of Row
        One for each parameter, in the order of `names`.
    """
    nominal = true_theta(names, scenario.nominal.as_array())
    error = theta - true_theta(names, true_parameters)
    lost = diverged(theta, bounds, scenario.period)
    at_rest = quiet(scenario)
    spans = windows(scenario, names)
    rows = []
    for i, name in enumerate(names):
        mine = [w for w in spans if w.parameter == physical(name)[0]]
        others = [w for w in spans if w not in mine]
        percent = 100 * error[:, i] / abs(nominal[i])
        tracked = [_track(error[w.start : w.stop, i] / w.size, scenario.period) for w in mine]
        times = [t10 for _, t10 in tracked]
        rows.append(
            Row(
                parameter=name,
                changed=bool(mine),
                lag=_mean([lag for lag, _ in tracked]),
                t10=None if None in times else _mean(times),
                std=_rms(percent[at_rest]),
                bias=finite(percent[at_rest].mean()) if at_rest.size else None,
                cross_talk=None
                if mine
                else _rms(np.concatenate([percent[w.start : w.stop] for w in others] or [[]])),
                diverged=lost,
                never_settled=None in times if mine else None,
            )
        )
    return rows


def _track(relative: Array, period: float) -> tuple[float | None, float | None]:
    """Return lag and t10 [s] of θ̃/D in one window; t10 is None if it ends outside ±10 %."""
    lag = finite(period * np.abs(relative).sum())
    outside = np.flatnonzero(~(np.abs(relative) <= 0.1))  # a NaN is outside
    settled = 0 if not outside.size else int(outside[-1]) + 1
    return lag, None if settled == len(relative) else settled * period


def diverged(theta: Array, bounds: tuple[Array, Array] | None, period: float) -> bool:
    """Whether a run is lost: an estimate not finite, or at a bound for more than 1 s."""
    if not np.isfinite(theta).all():
        return True
    if bounds is None:
        return False
    lower, upper = bounds
    on_edge = (theta <= lower) | (theta >= upper)
    longest = round(AT_BOUND / period)
    if len(theta) <= longest:
        return False
    run = np.cumsum(np.vstack([np.zeros((1, theta.shape[1]), int), on_edge]), axis=0)
    return bool(((run[longest + 1 :] - run[: -longest - 1]) == longest + 1).any())


def relative_error(
    scenario: Scenario, names: Sequence[str], theta: Array, true_parameters: Array
) -> dict[str, Array]:
    """Return θ̃/D (n,), signed, in the first window of each changed parameter.

    Without a fault, and started off the truth, it is θ̃ over the initial error from the first
    sample to the last: the convergence of the estimates.
    """
    error = theta - true_theta(names, true_parameters)
    columns = {physical(name)[0]: i for i, name in enumerate(names)}
    spans = [w for w in windows(scenario, names) if w.parameter in columns]
    if not scenario.events() and scenario.start != 1.0:
        truth = true_theta(names, scenario.nominal.as_array())
        told = started_nominal(scenario)
        start = true_theta(names, np.array([told[name] for name in PARAMETER_NAMES]))
        moved = [i for i in range(len(names)) if start[i] != truth[i]]
        return {names[i]: error[:, i] / abs(start[i] - truth[i]) for i in moved}
    first = {w.parameter: w for w in reversed(spans)}
    return {
        names[columns[p]]: error[w.start : w.stop, columns[p]] / w.size for p, w in first.items()
    }


def finite(value: float) -> float | None:
    """Return a number, or None where it is not finite: not defined, as it stands in the files."""
    return float(value) if np.isfinite(value) else None


def _mean(values: Sequence[float | None]) -> float | None:
    if not values or None in values:
        return None
    return float(np.mean(values))  # type: ignore[arg-type]


def _rms(values: Array) -> float | None:
    return finite(np.sqrt(np.mean(np.square(values)))) if len(values) else None
