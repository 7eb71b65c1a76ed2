"""Onsets that are drawn: what is known of all runs cannot be known of one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flexaxis.sim.streams import stream
from flexaxis.sim.timing import sample_index

if TYPE_CHECKING:
    from flexaxis.sim.scenario import Scenario


def drawn(scenario: Scenario, seed: int) -> Scenario:
    """Return a scenario as it is in the run of a seed: its faults where they come.

    It has the name, and the random numbers, of the scenario, and a hash of its own.
    """
    known: dict[int, Scenario] = scenario.__dict__.setdefault("_drawn", {})
    if seed not in known:
        known[seed] = scenario.override(_moved(scenario, seed))
    return known[seed]


def first_onset(scenario: Scenario) -> int:
    """Return the sample of the first fault; one of no size (factor 1) has an onset as well."""
    return min(scenario.grid.index(fault.at) for fault in scenario.fault)


def _moved(scenario: Scenario, seed: int) -> dict[str, Any]:
    """Return the keys of a scenario that are other in the run of a seed, with their values.

    Faults and pauses move by one time, so that what lies between them stays; nuisances do not. It
    is drawn evenly from the samples within `onset_spread` at which the reference moves if it does
    at the first fault as it is written, and rests if it rests.

    Parameters
    ----------
    scenario : Scenario
        With an `onset_spread`.
    seed : int
        Number of the run.
    """
    assert scenario.onset_spread is not None
    period, most = scenario.period, sample_index(scenario.onset_spread, scenario.period)
    allowed = np.arange(-most, most + 1)
    pauses = getattr(scenario.excitation, "pause", ())
    if scenario.fault and not pauses:  # else the pauses come along
        first, moves = first_onset(scenario), scenario.excited()
        allowed = allowed[moves[first + allowed] == moves[first]]
    by = int(stream(scenario.key, seed, "onset").choice(allowed))

    def later(time: float) -> float:
        return (sample_index(time, period) + by) / sample_index(1.0, period)

    found: dict[str, Any] = {"onset_spread": None, "streams": scenario.key, "name": scenario.name}
    for i, fault in enumerate(scenario.fault):
        for key in ("at", "until"):
            if (time := getattr(fault, key, None)) is not None:
                found[f"fault[{i}].{key}"] = later(time)
    if pauses:
        found["excitation.pause"] = [[later(start), later(end)] for start, end in pauses]
    return found
