"""Compute the changes in the true parameters during a run."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexaxis.sim.parameters import PARAMETER_UNITS, meant
from flexaxis.sim.tables.faults import Fault, changeable
from flexaxis.sim.timing import Grid

if TYPE_CHECKING:
    from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Event:
    """A change in a true parameter.

    Attributes
    ----------
    parameter : str
        Name of the parameter.
    index : int
        Index of the first sample with a changed value.
    before, after : float
        Parameter values before the change begins and after it is complete. The value `after` does
        not include other changes in the same parameter that are in progress (see `find_events`).
    """

    parameter: str
    index: int
    before: float
    after: float


def changed(nominal: float, name: str, changes: Iterable[Fault], grid: Grid) -> Array:
    """Return the value of the parameter `name` at each sample, as an array (N,).

    The value is the product of the nominal value and the factors of all changes in `changes` that
    affect the parameter `name`. The function ignores changes in other parameters.
    """
    factors = (change.factor_at(grid) for change in changes if meant(change.parameter) == name)
    return math.prod(factors, start=np.full(len(grid.k), nominal))


def find_events(
    faults: Sequence[Fault],
    nuisances: Sequence[Fault],
    grid: Grid,
    nominal: Mapping[str, float],
) -> tuple[Event, ...]:
    """Return the parameter changes that faults cause, in chronological order.

    An event combines all faults of one parameter that begin at the same sample. The value `before`
    of an event is the true parameter value at the sample before the onset. The value `after` is the
    parameter value that results when all faults of the event are complete. The value `after`
    ignores the further course of all other changes of the parameter: they keep their factors from
    the sample before the onset. Therefore the ratio after/before is the factor of the fault, even
    if another change of the parameter is in progress.

    Parameters
    ----------
    faults : sequence of Fault
        Faults that are scored.
    nuisances : sequence of Fault
        Other changes of the true parameters, which are not regarded as faults.
    grid : Grid
        Samples of the run.
    nominal : mapping of str to float
        Parameter values before the first fault, keyed by name.
    """
    changes = (*faults, *nuisances)
    settled: dict[tuple[int, str], dict[int, int]] = {}
    for number, fault in enumerate(faults):
        for first, last in fault.onsets(grid):
            settled.setdefault((first, meant(fault.parameter)), {})[number] = last
    events = []
    for (first, name), ends in settled.items():
        own = [(i, c) for i, c in enumerate(changes) if meant(c.parameter) == name]
        before, after = (
            math.prod(
                (float(c.factor_at(Grid(np.array([last.get(i, first - 1)]), grid.period))[0])
                 for i, c in own),
                start=nominal[name],
            )
            for last in ({}, ends)
        )  # fmt: skip
        if before != after:
            events.append(Event(name, first, before, after))
    order = changeable(PARAMETER_UNITS)
    return tuple(sorted(events, key=lambda e: (e.index, order.index(e.parameter))))


def first_onset(scenario: Scenario) -> int:
    """Return the index of the sample at which the first fault begins."""
    return min(scenario.grid.index(fault.at) for fault in scenario.fault)
