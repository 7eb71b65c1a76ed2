"""Draw random numbers: noise, the onsets of faults, and errors in the assumed parameters.

Each purpose has its own stream of random numbers, so the order of the draws does not matter.
"""

from __future__ import annotations

import math
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import numpy as np

from flexaxis.sim.parameters import DATA_SHEET
from flexaxis.sim.tables.events import first_onset
from flexaxis.sim.timing import sample_index

if TYPE_CHECKING:
    from flexaxis.sim.scenario import Scenario


def stream(key: str, seed: int, purpose: str) -> np.random.Generator:
    """Return the random number generator for one purpose in one run.

    Two generators are statistically independent if their keys, seeds or purposes differ. Two
    generators with the same key, seed and purpose produce the same numbers, even in different
    processes.

    Parameters
    ----------
    key : str
        Key of the scenario, `Scenario.key`.
    seed : int
        Seed of the run.
    purpose : str
        Purpose of the random numbers, for example ``"noise.speed"``.

    Notes
    -----
    The random number generator is Philox 4x64 (Salmon et al., 2011). The Philox key consists of the
    first 128 bits of a SHA-256 hash of `key`, `seed` and `purpose`.
    """
    digest = sha256(f"{key}/{seed}/{purpose}".encode()).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest[:16], "big")))


def drawn(scenario: Scenario, seed: int) -> Scenario:
    """Return the scenario for one seed, with random onsets and random errors in assumed values.

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

    The function multiplies the assumed value of each parameter that is not estimated by an
    independent random factor exp(spread z), where z is a standard normal variable. The random
    factors do not change the parameters of the simulated plant. The gear ratio has no random
    factor, because estimators know it exactly.
    """
    exact = {"r", *DATA_SHEET, *(name.removeprefix("1/") for name in scenario.identify)}
    known = dict.fromkeys(sorted(scenario.nominal.keys() - exact), 1.0) | scenario.known_factors
    for name in known.keys() - exact:
        z = stream(scenario.key, seed, f"known.{name}").standard_normal()
        known[name] *= math.exp(scenario.spread * z)
    return known | scenario.data_sheet


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
