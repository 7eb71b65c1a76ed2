"""An axis to step by hand, for a controller of one's own: torque in, sample out."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexaxis._records import changed
from flexaxis.experiments.studies.definition import seed_of
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.plant.loop import Changes
from flexaxis.sim.plant.plant import Plant
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.streams import stream
from flexaxis.sim.tables.nonlinear import substeps
from flexaxis.sim.tables.sensors import reading


class Sample(NamedTuple):
    """What is measured at a sample.

    Attributes
    ----------
    time : float
        [s].
    angle, speed, increment : float
        Motor angle [rad], motor speed [rad/s], and difference of angles over the period [rad/s].
    """

    time: float
    angle: float
    speed: float
    increment: float


class Axis:
    """The axis of a scenario, with its faults and its sensors, and without its controller.

    Parameters
    ----------
    scenario : Scenario
    seed : int
        Of the noise.

    Attributes
    ----------
    scenario : Scenario
    sample : Sample
        The latest; at first the axis is at rest.
    """

    def __init__(self, scenario: Scenario, *, seed: int = 0) -> None:
        if scenario.delay.torque_ticks:
            raise FlexaxisError(
                f"{scenario.name} delays the torque, which an axis stepped by hand does not: hold "
                "your own torque back, and leave `delay` out of the scenario"
            )
        self._seed = seed_of(seed)
        self.scenario = scenario.drawn(self._seed)
        self.reset()

    def reset(self) -> Sample:
        """Return to the start, at rest, and to the first of the noise."""
        scenario, nonlinear = self.scenario, list(self.scenario.nonlinear.values())
        self._plant = Plant(
            [scenario.nominal],
            period=scenario.period,
            substeps=substeps(nonlinear, scenario.period, least=scenario.substeps or 1),
            nonlinear=nonlinear,
            model=scenario.model,
        )
        self._changes, self._k = Changes([scenario]), 0
        sensors = list(scenario.sensors.values())
        self._read = {
            name: reading(sensors, name, self._white, period=scenario.period)
            for name in ("angle", "speed")
        }
        self._disturbance = scenario.noise.on_torque(self._white)
        self._before: float | None = None
        return self._measure()

    def _white(self, purpose: str) -> Any:
        generator = stream(self.scenario.key, self._seed, purpose)
        return generator.standard_normal(self.scenario.samples)[:, None]

    @property
    def done(self) -> bool:
        """Whether the scenario is over."""
        return self._k >= self.scenario.samples - 1

    @property
    def parameters(self) -> dict[str, float]:
        """True parameters that act now."""
        names, values = self.scenario.parameter_names, self.scenario.true_parameters()[self._k]
        return dict(zip(names, values.tolist(), strict=True))

    def step(self, torque: float) -> Sample:
        """Hold a torque [N m] for one period and return the sample at its end.

        Raises
        ------
        FlexaxisError
            If the torque is no finite number, or the scenario is over.
        SimulationError
            If the axis becomes unstable.
        """
        value = np.asarray(torque)
        if value.ndim or value.dtype.kind not in "iuf" or not np.isfinite(value):
            raise FlexaxisError(f"the torque is {torque!r}; give one finite number [N m]")
        if self.done:
            raise FlexaxisError(
                f"{self.scenario.name} is over after {self.scenario.duration:g} s: start again "
                "with reset(), or make a longer axis with duration=…"
            )
        more = 0.0 if self._disturbance is None else self._disturbance[self._k, 0]
        self._plant.step(np.array([float(value) + more]))
        self._k += 1
        return self._measure()

    def _measure(self) -> Sample:
        self._changes.make(self._plant, self._k)
        true = {"angle": self._plant.angle_m, "speed": self._plant.speed_m}
        angle, speed = (float(self._read[name](v[None, :].copy())[0, 0])
                        for name, v in true.items())  # fmt: skip
        period = self.scenario.period
        increment = 0.0 if self._before is None else (angle - self._before) / period
        self._before = angle
        self.sample = Sample(self._k * period, angle, speed, increment)
        return self.sample

    def __repr__(self) -> str:
        return f"Axis {self.scenario.name} at {self.sample.time:g} of {self.scenario.duration:g} s"


def make_axis(
    scenario: str | Path | Scenario = "fm_step-v1", *, seed: int = 0, **changes: Any
) -> Axis:
    """Return an axis to be stepped: ``sample = axis.step(torque)``.

    Parameters
    ----------
    scenario : str, Path or Scenario
        Its plant, faults and sensors; not its controller, which is yours.
    seed : int
        Of the noise.
    **changes
        As for `simulate`.

    Returns
    -------
    Axis
        At rest, at its first sample.

    Raises
    ------
    ScenarioError
        If there is no such scenario or key, or a value is not allowed.
    FlexaxisError
        If the scenario delays the torque: hold your own back.

    Examples
    --------
    >>> import flexaxis as fx
    >>> axis = fx.make_axis(duration=2.0, **{"fault[0].at": 1.0})
    >>> while not axis.done:
    ...     sample = axis.step(-0.2 * axis.sample.speed + 0.1)
    >>> round(sample.time, 3)
    1.995
    """
    return Axis(changed(scenario, changes), seed=seed)
