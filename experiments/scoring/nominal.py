"""The torque of a scenario's reference on the nominal axis, without faults and noise."""

from __future__ import annotations

import tomllib
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from flexaxis.sim.scenario import Scenario, scenario_from
from flexaxis.sim.simulate import simulate


def nominal_torque(scenario: Scenario) -> NDArray[np.float64]:
    """Return the torque (8000,) [N m] of 40 s on the scenario's reference at nominal parameters."""
    nominal = scenario.override(
        {
            "name": "nominal",
            "fault": [],
            "nuisance": None,
            "duration": 40.0,
            "start": 1.0,
            "noise": {},
            "streams": "content",  # of its own: the same for all points of a sweep over faults
        }
        | ({"excitation.pause": []} if hasattr(scenario.excitation, "pause") else {})
    )
    return _torque(nominal.to_toml())


@lru_cache(maxsize=64)
def _torque(toml: str) -> NDArray[np.float64]:
    # Keyed by content: within a run the same reference serves many estimators.
    torque = simulate(scenario_from(tomllib.loads(toml), source="nominal"), [0])[0].torque
    torque.setflags(write=False)
    return torque
