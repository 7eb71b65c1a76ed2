"""Compute the torque of the nominal axis during a scenario's reference motion.

The nominal axis has no faults and no noise.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.parameter_names import started_nominal
from flexaxis.experiments.scoring.windows import remembered
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import simulate
from flexaxis.sim.tables.excitation import Standstill

Array = NDArray[np.float64]
Torque = Callable[[Scenario], Array]
"""Function that returns the torque [N m] of a scenario for the seed 0, shape (N,)."""


def _simulated(scenario: Scenario) -> Array:
    return simulate(scenario, [0])[0].torque


_RUN: ContextVar[Torque] = ContextVar("run", default=_simulated)


@contextmanager
def nominal_runs(torque: Torque) -> Iterator[None]:
    """Within a context, call `torque` (for example, a cache) instead of simulating nominal runs."""
    before = _RUN.set(torque)
    try:
        yield
    finally:
        _RUN.reset(before)


@remembered
def nominal_torque(scenario: Scenario) -> Array:
    """Return the torque [N m] of the nominal axis in 40 s of reference motion, shape (8000,)."""
    nominal = scenario.override(
        {
            "name": "nominal",
            "fault": [],
            "nuisance": None,
            "onset_spread": None,
            "duration": 40.0,
            "start": 1.0,
            "known": None,
            "noise": {},
            "streams": "content",  # all points of a sweep over faults share the same torque
        }
        | ({"excitation.pause": []} if hasattr(scenario.excitation, "pause") else {})
    )
    return _torque(nominal)


@remembered
def design_torque(scenario: Scenario) -> Array:
    """
    Return the torque [N m] of an axis with the design values during 40 s of motion, shape (8000,).

    The design values are the nominal values that an estimator receives. The simulation contains no
    nonlinear effects, because estimators do not know these effects. If the axis does not move in
    the scenario, the reference motion is the default multisine.
    """
    told = started_nominal(scenario.override({"start": 1.0}))
    linear: dict[str, Any] = {key: None for key in scenario.nonlinear}
    linear |= {"fault": [], "nuisance": None, "onset_spread": None, "known": None, "substeps": None}
    inertias = [name for name in scenario.nominal if name[0] == "J"]
    usual = ["k_T", f"1/{inertias[-1]}", "f_m"]  # the random numbers depend on these names
    linear |= {"identify": usual, "output": "speed", "burn_in": 5.0}
    if isinstance(scenario.excitation, Standstill):
        linear |= {"excitation": {"kind": "multisine"}}
    return nominal_torque(
        scenario.override(linear | {f"parameters.{name}": told[name] for name in scenario.nominal})
    )


@partial(remembered, by="record_hash")
def _torque(scenario: Scenario) -> Array:
    # Many scenarios and estimators of a run share this torque.
    torque = _RUN.get()(scenario)
    torque.setflags(write=False)
    return torque
