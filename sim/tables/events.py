"""What changes in a run: values over time, and the events among the changes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flexaxis.sim.law_parameters import meant
from flexaxis.sim.parameters import PARAMETER_UNITS
from flexaxis.sim.tables.faults import Fault, changeable
from flexaxis.sim.timing import Grid

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Event:
    """A change of the truth.

    Attributes
    ----------
    parameter : str
        Name of the parameter.
    index : int
        First sample with a changed value.
    before, after : float
        Value before the change, and when it is complete; what else changes meanwhile is left
        out (see `find_events`).
    """

    parameter: str
    index: int
    before: float
    after: float


def changed(nominal: float, name: str, changes: Iterable[Fault], grid: Grid) -> Array:
    """Return a value (N,) over time: nominal times the factors of all changes that name it."""
    factors = (change.factor_at(grid) for change in changes if meant(change.parameter) == name)
    return math.prod(factors, start=np.full(len(grid.k), nominal))


def find_events(
    faults: Sequence[Fault],
    nuisances: Sequence[Fault],
    grid: Grid,
    nominal: Callable[[str], float],
) -> tuple[Event, ...]:
    """Return the changes by faults, in order of time.

    An event is what the faults that begin in one sample do to one parameter, and nothing else:
    `before` is the true value in the sample before, and `after` is what it would become if only
    they went on to where they settle, and every other change of the parameter, whether fault or
    nuisance, kept its factor of the sample before. So after/before is the factor of the fault,
    also where it falls into a ramp or a drift, or is overtaken by another.

    Parameters
    ----------
    faults : sequence of Fault
        What is scored; several on one parameter in one sample are one event.
    nuisances : sequence of Fault
        What else changes the truth.
    grid : Grid
        Samples of the run.
    nominal : callable
        ``nominal(name)``: the value that the factors multiply.
    """
    changes = (*faults, *nuisances)
    settled: dict[tuple[int, str], dict[int, int]] = {}
    for number, fault in enumerate(faults):
        for first, last in fault.onsets(grid):
            settled.setdefault((first, meant(fault.parameter)), {})[number] = last
    found = []
    for (first, name), ends in settled.items():
        value = partial(_product, nominal(name), name, changes, otherwise=first - 1)
        before, after = value({}, period=grid.period), value(ends, period=grid.period)
        if before != after:
            found.append(Event(name, first, before, after))
    order = changeable(PARAMETER_UNITS)
    return tuple(sorted(found, key=lambda e: (e.index, order.index(e.parameter))))


def _product(
    nominal: float,
    name: str,
    changes: Sequence[Fault],
    ends: Mapping[int, int],
    *,
    otherwise: int,
    period: float,
) -> float:
    """Return nominal times the factor of each change of `name`, in a sample of its own.

    That is the one in `ends` for the changes numbered there, and `otherwise` for the others.
    """
    value = nominal
    for number, change in enumerate(changes):
        if meant(change.parameter) == name:
            sample = ends.get(number, otherwise)
            value *= float(change.factor_at(Grid(np.array([sample]), period))[0])
    return value
