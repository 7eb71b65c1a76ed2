"""What the contenders work on: a record of the paper's axis with a fault, and its model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators import three_mass
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import simulate

Array = NDArray[np.float64]

IDENTIFY = ("k_T", "1/J_a", "f_m")
SCENARIO = "fm_step-v1"
BOX = (0.2, 5.0)  # times nominal


@dataclass(frozen=True)
class Problem:
    """A record, and what is known of the axis.

    Attributes
    ----------
    scenario : Scenario
    u, y : ndarray (N,)
        Torque [N m] and speed [rad/s].
    quiet : (u, y)
        The same without the fault.
    """

    scenario: Scenario
    u: Array
    y: Array
    quiet: tuple[Array, Array]

    @property
    def period(self) -> float:
        """Sampling period [s]."""
        return self.scenario.period

    @property
    def noise(self) -> float:
        """Standard deviation of y [rad/s]."""
        return float(self.scenario.noise.speed)

    @property
    def model(self) -> Model:
        """The axis, linear."""
        return three_mass(self.scenario.nominal.as_dict())

    @property
    def parametrization(self) -> Parametrization:
        """The model as a function of the three parameters of the paper."""
        return self.model.parametrize(IDENTIFY)

    @property
    def prior(self) -> tuple[Array, Array]:
        """Variance of θ(0), and what it gains in a sample: of the extended Kalman filters."""
        theta = self.parametrization.theta
        return (0.1 * theta) ** 2, (1e-4 * theta) ** 2


@cache
def problem() -> Problem:
    """Return what everything is timed on."""
    scenario = find_scenario(SCENARIO)
    signals = []
    for one in (scenario, scenario.override({"fault": []}, inherit=True)):
        record = simulate(one, [0])[0]
        assert record.speed is not None  # a simulated record has all signals
        signals.append((record.torque, record.speed))
    return Problem(scenario, *signals[0], quiet=signals[1])
