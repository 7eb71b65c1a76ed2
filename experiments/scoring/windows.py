"""Select the samples to score: an interval before a fault and a window after the fault."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.parameter_names import physical
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.tables.events import Event
from flexaxis.sim.timing import sample_index

Function = TypeVar("Function", bound=Callable[..., Any])
KEPT = 256  # number of results that a cached function keeps


def remembered(function: Function, by: str = "hash") -> Function:
    """Return a version of `function` that caches its results, keyed by a hash of the scenario."""
    results: dict[Any, Any] = {}

    @wraps(function)
    def cached(scenario: Scenario, *more: Any) -> Any:
        key = getattr(scenario, by), *more
        if key not in results:
            results[key] = function(scenario, *more)
        if len(results) > KEPT:
            del results[next(iter(results))]
        return results[key]

    return cached  # type: ignore[return-value]


WINDOW = 5.0  # time after a fault that is scored, unless another event occurs earlier [s]
QUIET = 5.0  # time with excitation before the first onset, for std and bias [s]
QUIET_WITHOUT_FAULT = 10.0  # time at the end of a run without a fault, for std and bias [s]


@dataclass(frozen=True)
class Window:
    """The scored samples after a change in one parameter, from `start` to `stop` − 1.

    `D` is the size of the fault, |θ_after − θ_before|, in the unit of the estimated parameter.
    """

    parameter: str
    start: int
    stop: int
    D: float


def windows(scenario: Scenario, names: Sequence[str]) -> list[Window]:
    """Return the scored windows of all events, in chronological order.

    A window starts at the fault. If the excitation pauses when the fault occurs, the window starts
    when the excitation returns. A window ends after 5 s, at the next event, or at the end of the
    record. Several changes in a parameter during one pause share a window, and `D` is the size of
    the total change. If the parameter is not estimated, `D` is NaN, and the window is used only for
    the cross-talk of other parameters.
    """
    return list(_windows(scenario, tuple(names)))


@remembered
def _windows(scenario: Scenario, names: tuple[str, ...]) -> list[Window]:
    starts = [(_clock(scenario, event), event) for event in scenario.events()]
    spans = []
    for start, name in dict.fromkeys((start, event.parameter) for start, event in starts):
        own = [e for s, e in starts if (s, e.parameter) == (start, name)]
        size = _size(own[0].before, own[-1].after, name, names)
        # Parameters that change at the same sample share a window.
        later = [other for other, _ in starts if other > start]
        stop = min(start + round(WINDOW / scenario.period), *later, scenario.samples)
        if size != 0 and stop > start:
            spans.append(Window(name, start, stop, size))
    return spans


def _clock(scenario: Scenario, event: Event) -> int:
    moving = np.flatnonzero(scenario.excited()[event.index :])
    return event.index + (int(moving[0]) if moving.size else 0)


def _size(before: float, after: float, changed: str, names: Sequence[str]) -> float:
    for name in names:
        parameter, exponent = physical(name)
        if parameter == changed:
            return abs(after**exponent - before**exponent)
    return np.nan


def claimed_at(scenario: Scenario) -> int:
    """Return the index of the sample at which the covariance of an estimator is recorded.

    The covariance is recorded at the last sample of the last full second before the first fault. If
    there is no fault, or if the fault occurs in the first second, the covariance is recorded at the
    last sample of the run.
    """
    events, second = scenario.events(), sample_index(1.0, scenario.period)
    whole = events[0].index // second * second if events else 0
    return (whole or scenario.samples) - 1


@remembered
def quiet(scenario: Scenario) -> NDArray[np.intp]:
    """Return the indices of the samples that are used for the scores std and bias.

    In a run with a fault, the samples are the last 5 s with excitation between burn-in and the
    first fault. In a run without a fault, the samples are the last 10 s. If a run without a fault
    is shorter than 20 s, the samples are the second half of the run.
    """
    events = scenario.events()
    if not events:
        half = scenario.samples // 2
        length = min(round(QUIET_WITHOUT_FAULT / scenario.period), half)
        samples = np.arange(scenario.samples - length, scenario.samples)
    else:
        burnt = round(scenario.burn_in / scenario.period)
        usable = np.flatnonzero(scenario.excited()[: events[0].index])
        samples = usable[usable >= burnt][-round(QUIET / scenario.period) :]
    samples.flags.writeable = False  # all callers share the array
    return samples
