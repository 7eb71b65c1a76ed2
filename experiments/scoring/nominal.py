"""The torque of a scenario's reference on the nominal axis, without faults and noise."""

from __future__ import annotations

import tomllib
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.theta import started_nominal
from flexaxis.sim.excitation import Standstill
from flexaxis.sim.parameters import DEFAULT_IDENTIFY, PARAMETER_NAMES
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


def design_torque(scenario: Scenario) -> NDArray[np.float64]:
    """
    Return the torque (8000,) [N m] of 40 s on the reference of the axis as it was designed.

    That is what is told of it: nothing of what it has beyond the linear model comes in. An axis
    that is never moved here was designed to move all the same: then it is that of the multisine.
    """
    told = started_nominal(scenario.override({"start": 1.0}))
    linear: dict[str, Any] = {key: None for key in scenario.nonlinear}
    linear |= {"fault": [], "nuisance": None, "told": None, "substeps": None}
    linear |= {"identify": list(DEFAULT_IDENTIFY), "output": "speed", "burn_in": 5.0}
    if isinstance(scenario.excitation, Standstill):
        linear |= {"excitation": {"kind": "multisine"}}
    return nominal_torque(
        scenario.override(linear | {f"parameters.{name}": told[name] for name in PARAMETER_NAMES})
    )


@lru_cache(maxsize=64)
def _torque(toml: str) -> NDArray[np.float64]:
    # Keyed by content: within a run the same reference serves many estimators.
    torque = simulate(scenario_from(tomllib.loads(toml), source="nominal"), [0])[0].torque
    torque.setflags(write=False)
    return torque
