"""What changes in a run: values over time, and the events among the changes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.sim.faults import CHANGEABLE, Fault
from flexaxis.sim.timing import PERIOD

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Event:
    """A change of the truth.

    Attributes
    ----------
    parameter : str
        Name of the parameter, or "coulomb".
    index : int
        First sample with a changed value.
    before, after : float
        Value before the change, and when it is complete.
    """

    parameter: str
    index: int
    before: float
    after: float


def changed(nominal: float, name: str, changes: Iterable[Fault], times: Array) -> Array:
    """Return a value (N,) over time: nominal times the factors of all changes that name it."""
    factors = (change.factor_at(times) for change in changes if change.parameter == name)
    return math.prod(factors, start=np.full(len(times), nominal))


def find_events(
    faults: Iterable[Fault], times: Array, value: Callable[[str, Array], Array]
) -> tuple[Event, ...]:
    """Return the changes by faults, in order of time.

    Parameters
    ----------
    faults : iterable of Fault
        What happens; several on one parameter in one sample are one event.
    times : ndarray (N,)
        Sample times of the run [s].
    value : callable
        ``value(name, times)``: the true value at times (M,).
    """
    settled: dict[tuple[int, str], int] = {}
    for fault in faults:
        for first, last in fault.onsets(times):
            key = first, fault.parameter
            settled[key] = max(last, settled.get(key, last))
    found = []
    for (first, name), last in settled.items():
        before, after = value(name, np.array([first - 1, last]) * PERIOD).tolist()
        if before != after:
            found.append(Event(name, first, before, after))
    return tuple(sorted(found, key=lambda e: (e.index, CHANGEABLE.index(e.parameter))))
