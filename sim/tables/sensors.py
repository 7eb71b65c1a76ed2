"""Sensors between the axis and its log: delay, noise, encoder and filter, each one stage.

Every table has a `stage` that changes a signal, and states whether the linear model still describes
the result (`exact`). A signal passes through all stages in the order of the keys of `Scenario`,
for the log and, if it uses measured feedback, for the controller.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import reduce
from typing import Annotated, ClassVar, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from flexaxis.sim.tables.config import Config, NotNegative, Positive
from flexaxis.sim.timing import TICK

Array = NDArray[np.float64]

Signal = Literal["angle", "speed"]
"""What is measured of the motor: angle [rad] and speed [rad/s]."""

Stage = Callable[[Array], Array]
"""Takes the next n samples (n, R) of a signal, and returns what becomes of them."""

White = Callable[[str], Array]
"""Returns white noise (N, R) of standard deviation 1 for a purpose, such as "noise.speed"."""


@runtime_checkable
class Sensor(Protocol):
    """A table of a scenario with a `stage` that signals pass through."""

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return the stage for a signal sampled every `period` s, at rest before the run."""


def reading(sensors: Iterable[Sensor], signal: Signal, white: White, *, period: float) -> Stage:
    """Return the way of a signal through the stages of all sensors.

    Parameters
    ----------
    sensors : iterable of Sensor
        In the order in which the signal meets them.
    signal : {"angle", "speed"}
    white : callable
        Returns the noise of the whole run for a purpose.
    period : float
        Sampling period T [s].

    Returns
    -------
    callable
        Takes the next samples (n, R) and returns what is read: all of a run at once, or one
        sample at a time, with the same bits.
    """
    stages = [sensor.stage(signal, white, period) for sensor in sensors]
    return lambda values: reduce(lambda passed, stage: stage(passed), stages, values)


def _unchanged(values: Array) -> Array:
    return values


class NoiseConfig(Config):
    """White noise; the table ``[noise]`` of a scenario.

    Attributes
    ----------
    speed : float
        Standard deviation on the motor speed [rad/s].
    angle : float
        Standard deviation on the motor angle, before the encoder rounds it [rad].
    torque : float, optional
        Standard deviation of what acts over what is commanded, new in every sample [N m]. The log
        has the command, so that this is an error in the input, and no noise of the output.
    """

    speed: NotNegative = 0.1
    angle: NotNegative = 0.0
    torque: Positive | None = None

    @property
    def exact(self) -> bool:
        """Whether the logged torque is the acting torque."""
        return self.torque is None

    def on_torque(self, white: White) -> Array | None:
        """Return the disturbance torque (N, R) [N m], or None."""
        return self.torque * white("noise.torque") if self.torque else None

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return the adding of noise to a signal."""
        deviation = self.speed if signal == "speed" else self.angle
        return _added(deviation * white(f"noise.{signal}")) if deviation else _unchanged

    def in_words(self) -> str:
        """Return how much noise there is."""
        deviations = [(self.speed, "rad/s on the speed"), (self.angle, "rad on the angle"),
                 (self.torque, "N m on the torque that acts")]  # fmt: skip
        return "; ".join(f"noise of {value:g} {words}" for value, words in deviations if value)


class EncoderConfig(Config):
    """Resolution of the motor angle; the table ``[encoder]`` of a scenario.

    Attributes
    ----------
    counts : int
        Counts per revolution of the motor (65536 for 16 bits); 0 is an ideal encoder.
    """

    exact: ClassVar[bool] = True  # the bounds know of rounding
    counts: int = Field(default=0, ge=0)

    @field_validator("counts")
    @classmethod
    def _counts_and_not_bits(cls, counts: int) -> int:
        if 0 < counts < 64:
            raise ValueError(
                f"{counts} counts per revolution are too few to control with; {counts} bits are "
                f"{2**counts} counts"
            )
        return counts

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return the rounding of the angle to the nearest count."""
        if signal != "angle" or not self.counts:
            return _unchanged
        step = 2 * math.pi / self.counts
        return lambda values: np.rint(values / step) * step

    def in_words(self) -> str:
        """Return its resolution."""
        return f"encoder of {self.counts} counts" if self.counts else ""


class DelayConfig(Config):
    """Delays of the signals; the table ``[delay]`` of a scenario.

    Attributes
    ----------
    measurement : int
        Whole samples by which angle and speed are late.
    torque : float, optional
        Time from a torque command to its action [s], a multiple of 1 ms. The log has the command.
    """

    measurement: int = Field(default=0, ge=0, le=1000)
    torque: Annotated[float, Field(gt=0, le=0.1)] | None = None

    @field_validator("torque")
    @classmethod
    def _whole_ticks(cls, torque: float | None) -> float | None:
        if torque and abs(torque / TICK - round(torque / TICK)) > 1e-6:
            raise ValueError(f"must be a multiple of {TICK:g} s, not {torque:g}")
        return torque

    @property
    def exact(self) -> bool:
        """Whether nothing is late."""
        return not (self.measurement or self.torque)

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return the delay of a measured signal; the log has the torque when it is commanded."""
        return _late(self.measurement) if self.measurement else _unchanged

    def in_words(self) -> str:
        """Return the delays in words."""
        words = [f"measurement late by {self.measurement} samples"] if self.measurement else []
        words += [f"torque late by {1000 * self.torque:g} ms"] if self.torque else []
        return "; ".join(words)

    @property
    def torque_ticks(self) -> int:
        """Delay of the torque in ticks of 1 ms."""
        return round((self.torque or 0.0) / TICK)


class FilterConfig(Config):
    """Low-pass filter of the logged speed; the table ``[filter]``.

    Attributes
    ----------
    speed : float
        Time constant of a first-order low-pass on the measured speed, noise and all [s].
    """

    exact: ClassVar[bool] = False
    speed: Positive

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return the low-pass on the speed."""
        return _low_pass(self.speed, period) if signal == "speed" else _unchanged

    def in_words(self) -> str:
        """Return its time constant."""
        return f"speed through a low-pass of {1000 * self.speed:g} ms"


def _late(samples: int) -> Stage:
    """Return what makes a signal late by whole samples; it is at rest (zero) before."""
    waiting: Array | None = None

    def stage(values: Array) -> Array:
        nonlocal waiting
        before = np.zeros((samples, *values.shape[1:])) if waiting is None else waiting
        queue = np.concatenate([before, values])
        waiting = queue[len(values) :]
        return queue[: len(values)]

    return stage


def _added(noise: Array) -> Stage:
    """Return what adds noise (N, R) to a signal, sample by sample."""
    done = 0

    def stage(values: Array) -> Array:
        nonlocal done
        first, done = done, done + len(values)
        return values + noise[first:done]

    return stage


def _low_pass(time_constant: float, period: float) -> Stage:
    """Return f[k] = a f[k−1] + (1−a) s[k], a = exp(−T/τ), from rest."""
    pole = math.exp(-period / time_constant)
    last: Array | float = 0.0

    def stage(values: Array) -> Array:
        nonlocal last
        out = np.empty_like(values)
        for k, value in enumerate(values):
            last = out[k] = (1 - pole) * value + pole * last
        return out

    return stage


def angle_increment(angle: Array, *, period: float) -> Array:
    """Return the rate (φ[k] − φ[k−1])/T of a sampled angle (N, ...) [rad/s], 0 at k = 0."""
    return np.diff(angle, axis=0, prepend=angle[:1]) / period
