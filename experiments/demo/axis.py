"""Simulate an axis in closed loop, and change its parameters, friction, sensor and reference."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.bounds import noise_variance
from flexaxis.experiments.scoring.parameter_names import true_theta
from flexaxis.sim.parameters import AxisParameters, preset
from flexaxis.sim.plant.plant import Plant
from flexaxis.sim.random_draws import stream
from flexaxis.sim.scenario import scenario_from
from flexaxis.sim.tables.controller import Controller, ControllerConfig
from flexaxis.sim.tables.excitation import Multisine
from flexaxis.sim.tables.nonlinear import substeps
from flexaxis.sim.tables.sensors import NoiseConfig
from flexaxis.sim.timing import PERIOD

Array = NDArray[np.float64]

FRICTION: Mapping[str, Mapping[str, Any]] = {
    "none": {},
    "Coulomb 0.1 N m": {"friction": {"coulomb": 0.1}},
    "LuGre": {
        "lugre": {
            "coulomb": 0.1, "static": 0.2, "stribeck": 0.5, "stiffness": 100.0, "damping": 0.3
        }
    },
}  # fmt: skip
"""Scenario tables that define each friction model, keyed by the model's label on the web page.

Compare the friction torques with the root-mean-square motor torque, which is 0.85 N m.
"""

SENSORS: Mapping[str, Mapping[str, Any]] = {
    "speed with noise": {},
    "encoder, 2048 counts": {"output": "angle", "encoder": {"counts": 2048}},
}
"""Scenario keys that define each motor sensor, keyed by the sensor's label on the web page.

The encoder rounds the motor angle to the nearest count, but adds no noise.
"""

EXCITATION = ("on", "stop-and-go", "off")
SPELL = 10.0
"""Duration of each motion and of each standstill in the mode "stop-and-go" [s]."""


class LiveAxis:
    """An axis in closed loop, which is simulated step by step.

    Parameters
    ----------
    seed : int
        Random seed of the reference and of the noise. The simulation gives the same results for the
        same seed and the same user actions.

    Attributes
    ----------
    nominal, parameters : AxisParameters
        Nominal parameters, and current parameters including all faults.
    scenario : Scenario
        Scenario with the current friction model and the current sensor.
    samples : int
        Number of samples that have been simulated.
    noise : float
        Standard deviation of the motor speed noise [rad/s].
    excitation : {"on", "stop-and-go", "off"}
        Mode of the reference. If `excitation` is "on", the reference moves all the time. If
        `excitation` is "stop-and-go", motion and standstill alternate. If `excitation` is "off",
        the reference keeps its last value.
    """

    def __init__(self, *, seed: int = 0) -> None:
        self.nominal = self.parameters = preset("n1")
        self.noise = NoiseConfig().speed
        self.excitation = EXCITATION[0]
        self.samples = self._moved = 0
        self._signal = Multisine().one_period(stream("demo", seed, "excitation"), PERIOD)
        self._white = stream("demo", seed, "noise.speed")
        self._controller = Controller(ControllerConfig(), 1, period=PERIOD)
        self._plant: Any = None
        self._friction, self._sensor = FRICTION["none"], SENSORS["speed with noise"]
        self._build()

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.samples * PERIOD

    @property
    def output(self) -> str:
        """Name of the measured signal that the estimators receive, either speed or angle."""
        return self.scenario.output

    @property
    def variance(self) -> float:
        """Noise variance of the measured signal that the estimators receive."""
        return self.noise**2 if self.output == "speed" else noise_variance(self.scenario)

    @property
    def excited(self) -> bool:
        """Whether the reference moves during the next sample."""
        going = self.time // SPELL % 2 == 0
        return self.excitation == "on" or (self.excitation == "stop-and-go" and going)

    @property
    def angles(self) -> Array:
        """Angles of motor, gear and arm [rad], as an array (3,)."""
        angles: Array = self._plant.angles[0].copy()
        return angles

    @property
    def state(self) -> Array:
        """State of the axis: two joint twists [rad], and speeds of motor, gear and arm [rad/s]."""
        motor, gear, arm = self.angles
        return np.array([self.parameters.r * motor - gear, gear - arm, *self._plant.speeds[0]])

    @property
    def values(self) -> Array:
        """Current parameter values in the order of `Scenario.parameter_names`, as an array (P,)."""
        return np.array([*self.parameters.values(), *self.scenario.laws.values()])

    def theta(self, names: Sequence[str]) -> Array:
        """Return the true values of the parameters in `names`; f_c is 0 without dry friction."""
        values = {"f_c": 0.0} | self.parameters.as_dict() | self.scenario.laws
        return true_theta(names, np.array([*values.values()]), tuple(values))

    def set_factors(self, factors: Mapping[str, float]) -> None:
        """Set some parameters to multiples of their nominal values, and all others to nominal.

        The argument `factors` contains the ratios of new to nominal values, keyed by parameter.
        """
        values = {n: v * factors.get(n, 1.0) for n, v in self.nominal.as_dict().items()}
        parameters = AxisParameters(**values)
        self._plant.set_parameters([parameters])
        self.parameters = parameters

    def set_friction(self, kind: str) -> None:
        """Use the friction model with the given label in `FRICTION`; keep all angles and speeds."""
        self._friction = FRICTION[kind]
        self._build()

    def set_sensor(self, kind: str) -> None:
        """Use the motor sensor with the given label in `SENSORS`."""
        self._sensor = SENSORS[kind]
        self._build()

    def _build(self) -> None:
        """Build the plant with the current friction model, without changing angles and speeds."""
        content = {
            "name": "live",
            "duration": 1.0,
            "preset": "n1",
            **self._friction,
            **self._sensor,
        }
        self.scenario = scenario_from(content, source="live axis")
        laws, old = [*self.scenario.nonlinear.values()], self._plant
        self._plant = Plant(
            [self.parameters], period=PERIOD, substeps=substeps(laws, PERIOD), nonlinear=laws
        )
        if old is not None:
            self._plant.angles[:], self._plant.speeds[:] = old.angles, old.speeds

    def advance(self, samples: int) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Simulate the axis for a number of samples.

        Returns
        -------
        torque, measured, excited : ndarray (samples,)
            Torque [N m], measured motor signal (speed [rad/s] or angle [rad]), and whether the
            reference moves, at each sample.
        """
        torque, speed, angle = np.empty((3, samples))
        excited = np.empty(samples, bool)
        for k in range(samples):
            excited[k] = self.excited
            speed[k], angle[k] = self._plant.speed_m[0], self._plant.angle_m[0]
            self._moved += int(excited[k])
            reference = self._signal[[(self._moved - 1) % len(self._signal)]]
            torque[k] = self._controller.torque(reference, self._plant.angle_m)[0]
            self._plant.step(torque[k : k + 1])
            self.samples += 1
        noise = self.noise * self._white.standard_normal(samples)
        if self.output == "speed":
            return torque, speed + noise, excited
        read = self.scenario.encoder.stage("angle", lambda purpose: np.empty(0), PERIOD)
        return torque, read(angle), excited
