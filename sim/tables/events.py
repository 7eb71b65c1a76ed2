"""Compute the parameter changes during a run, and draw random onsets and parameter errors."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.sim.parameters import DATA_SHEET, PARAMETER_UNITS, meant
from flexaxis.sim.streams import stream
from flexaxis.sim.tables.faults import Fault, changeable
from flexaxis.sim.timing import Grid, sample_index

if TYPE_CHECKING:
    from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Event:
    """A change of a true parameter.

    Attributes
    ----------
    parameter : str
        Name of the parameter.
    index : int
        Index of the first sample with a changed value.
    before, after : float
        Parameter values before the change and after the complete change. The value `after` does not
        include other changes of the same parameter that are in progress (see `find_events`).
    """

    parameter: str
    index: int
    before: float
    after: float


def changed(nominal: float, name: str, changes: Iterable[Fault], grid: Grid) -> Array:
    """Return the value of the parameter `name` at each sample, as an array (N,).

    The value is the product of the nominal value and the factors of all changes in `changes` that
    affect the parameter `name`. The function ignores changes of other parameters.
    """
    factors = (change.factor_at(grid) for change in changes if meant(change.parameter) == name)
    return math.prod(factors, start=np.full(len(grid.k), nominal))


def find_events(
    faults: Sequence[Fault],
    nuisances: Sequence[Fault],
    grid: Grid,
    nominal: Mapping[str, float],
) -> tuple[Event, ...]:
    """Return the parameter changes that faults cause, in order of time.

    An event combines all faults of one parameter that begin at the same sample. The value `before`
    of an event is the true parameter value at the sample before the onset. The value `after` is the
    parameter value that results when all faults of the event are complete. For the value `after`,
    all other changes of the parameter keep the factor that they have at the sample before the
    onset. Therefore the ratio after/before is the factor of the fault, even if another change of
    the parameter is in progress.

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


def drawn(scenario: Scenario, seed: int) -> Scenario:
    """Return the scenario of one seed, with random onsets and random errors of assumed parameters.

    The new scenario has the same name and the same random numbers as `scenario`, but a different
    hash.
    """
    runs: dict[int, Scenario] = scenario.__dict__.setdefault("_drawn", {})
    if seed not in runs:
        changes: dict[str, Any] = {"streams": scenario.key, "name": scenario.name}
        changes |= _moved(scenario, seed) if scenario.onset_spread else {}
        changes |= {"known": _known(scenario, seed)} if scenario.spread else {}
        runs[seed] = scenario.override(changes)
    return runs[seed]


def _known(scenario: Scenario, seed: int) -> dict[str, float]:
    """Return the table `known` of a scenario for one seed, including random parameter errors.

    The assumed value of every parameter that is not estimated is multiplied by an independent
    random factor exp(spread z), where z is a standard normal variable. The random factors do not
    change the parameters of the simulated plant. The gear ratio has no random factor, because
    estimators know it exactly.
    """
    exact = {"r", *DATA_SHEET, *(name.removeprefix("1/") for name in scenario.identify)}
    known = dict.fromkeys(sorted(scenario.nominal.keys() - exact), 1.0) | scenario.known_factors
    for name in known.keys() - exact:
        z = stream(scenario.key, seed, f"known.{name}").standard_normal()
        known[name] *= math.exp(scenario.spread * z)
    return known | scenario.data_sheet


def first_onset(scenario: Scenario) -> int:
    """Return the index of the sample at which the first fault begins."""
    return min(scenario.grid.index(fault.at) for fault in scenario.fault)


def _moved(scenario: Scenario, seed: int) -> dict[str, Any]:
    """Draw a random time shift, and return the new times of faults and pauses, keyed by dotted key.

    All faults and pauses are shifted by the same time, so the intervals between faults and pauses
    do not change. Nuisances are not shifted. The time shift is uniformly distributed from
    -`onset_spread` to +`onset_spread`, in steps of one sample. If the reference moves at the
    nominal onset of the first fault, it also moves at the shifted onset. If the reference rests at
    the nominal onset, it also rests at the shifted onset.

    Parameters
    ----------
    scenario : Scenario
        Scenario with an `onset_spread`.
    seed : int
        Seed of the run.
    """
    assert scenario.onset_spread is not None
    period, most = scenario.period, sample_index(scenario.onset_spread, scenario.period)
    allowed = np.arange(-most, most + 1)
    pauses = getattr(scenario.excitation, "pause", ())
    if scenario.fault and not pauses:  # pauses shift together with the fault
        first, moves = first_onset(scenario), scenario.excited()
        allowed = allowed[moves[first + allowed] == moves[first]]
    by = int(stream(scenario.key, seed, "onset").choice(allowed))

    def later(time: float) -> float:
        return (sample_index(time, period) + by) / sample_index(1.0, period)

    changes: dict[str, Any] = {"onset_spread": None}
    for i, fault in enumerate(scenario.fault):
        for key in ("at", "until"):
            if (time := getattr(fault, key, None)) is not None:
                changes[f"fault[{i}].{key}"] = later(time)
    if pauses:
        changes["excitation.pause"] = [[later(start), later(end)] for start, end in pauses]
    return changes
