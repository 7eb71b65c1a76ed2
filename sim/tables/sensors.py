"""Define the sensors (delay, noise, encoder and filter), which turn the motion into logged signals.

The method `stage` of a table returns a function that changes a signal. The attribute `exact` states
whether the linear model still describes the changed signal. A signal passes through all stages in
the order of the keys of `Scenario`. The log contains the output of the last stage. The controller
reads this output if the feedback is "measured"; otherwise the controller reads the true angle.
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
"""Name of a measured signal of the motor: angle [rad] or speed [rad/s]."""

Stage = Callable[[Array], Array]
"""Function that takes the next n samples (n, R) of a signal and returns the processed samples."""

White = Callable[[str], Array]
"""Function that takes the purpose of the noise, for example "noise.speed", and returns white noise
(N, R) with standard deviation 1."""


@runtime_checkable
class Sensor(Protocol):
    """A scenario table with a `stage` that processes measured signals."""

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return the stage that processes a signal with the sampling period `period` [s].

        The stage assumes that the signal is 0 before the run.
        """


def reading(sensors: Iterable[Sensor], signal: Signal, white: White, *, period: float) -> Stage:
    """Return the composition of the stages of all sensors for one signal.

    Parameters
    ----------
    sensors : iterable of Sensor
        Sensor tables in the order in which the signal passes through them.
    signal : {"angle", "speed"}
        Signal to measure.
    white : callable
        Function that takes the purpose of the noise and returns the noise of the whole run.
    period : float
        Sampling period T [s].

    Returns
    -------
    callable
        Function that takes the next samples (n, R) of the true signal and returns the measured
        samples. The result is bitwise the same if the function processes a run at once or sample by
        sample.
    """
    stages = [sensor.stage(signal, white, period) for sensor in sensors]
    return lambda values: reduce(lambda passed, stage: stage(passed), stages, values)


def _unchanged(values: Array) -> Array:
    return values


class NoiseConfig(Config):
    """The table ``[noise]`` of a scenario: levels of the white noise.

    Attributes
    ----------
    speed : float
        Standard deviation of the noise of the measured motor speed [rad/s].
    angle : float
        Standard deviation of the noise that is added to the motor angle before the encoder rounds
        the angle [rad].
    torque : float, optional
        Standard deviation of a disturbance torque with an independent value in each sample, which
        is added to the command [N m]. The log contains only the command. Therefore the disturbance
        is an input error and not output noise.
    """

    speed: NotNegative = 0.1
    angle: NotNegative = 0.0
    torque: Positive | None = None

    @property
    def exact(self) -> bool:
        """Whether the logged torque equals the torque that acts on the motor."""
        return self.torque is None

    def on_torque(self, white: White) -> Array | None:
        """Return the disturbance torque (N, R) [N m], or None if there is no disturbance."""
        return self.torque * white("noise.torque") if self.torque else None

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return the stage that adds noise to a signal."""
        deviation = self.speed if signal == "speed" else self.angle
        return _added(deviation * white(f"noise.{signal}")) if deviation else _unchanged

    def in_words(self) -> str:
        """Return a description of the noise levels, for messages and tables."""
        deviations = [(self.speed, "rad/s on the speed"), (self.angle, "rad on the angle"),
                 (self.torque, "N m on the acting torque")]  # fmt: skip
        return "; ".join(f"noise of {value:g} {words}" for value, words in deviations if value)


class EncoderConfig(Config):
    """The table ``[encoder]`` of a scenario: resolution of the measured motor angle.

    Attributes
    ----------
    counts : int
        Number of counts per revolution of the motor (65536 for 16 bits); 0 means an ideal encoder.
    """

    exact: ClassVar[bool] = True  # the bounds include the rounding of the encoder
    counts: int = Field(default=0, ge=0)

    @field_validator("counts")
    @classmethod
    def _counts_and_not_bits(cls, counts: int) -> int:
        if 0 < counts < 64:
            raise ValueError(
                f"{counts} counts per revolution are too few for control; {counts} bits are "
                f"{2**counts} counts"
            )
        return counts

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return the stage that rounds the angle to the nearest count."""
        if signal != "angle" or not self.counts:
            return _unchanged
        step = 2 * math.pi / self.counts
        return lambda values: np.rint(values / step) * step

    def in_words(self) -> str:
        """Return a description of the resolution, for messages and tables."""
        return f"encoder of {self.counts} counts" if self.counts else ""


class DelayConfig(Config):
    """The table ``[delay]`` of a scenario: delays of the signals.

    Attributes
    ----------
    measurement : int
        Delay of the measured angle and speed [samples].
    torque : float, optional
        Time from a torque command to its effect [s], a multiple of 1 ms. The log contains the
        torque at the time of the command.
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
        """Whether there is no delay."""
        return not (self.measurement or self.torque)

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return the stage that delays a measured signal."""
        return _late(self.measurement) if self.measurement else _unchanged

    def in_words(self) -> str:
        """Return a description of the delays, for messages and tables."""
        words = [f"measurement delayed by {self.measurement} samples"] if self.measurement else []
        words += [f"torque delayed by {1000 * self.torque:g} ms"] if self.torque else []
        return "; ".join(words)

    @property
    def torque_ticks(self) -> int:
        """Delay of the torque in ticks of 1 ms."""
        return round((self.torque or 0.0) / TICK)


class FilterConfig(Config):
    """The table ``[filter]`` of a scenario: low-pass filter of the logged speed.

    Attributes
    ----------
    speed : float
        Time constant of the first-order low-pass filter of the measured speed [s]. The filter acts
        on the sum of speed and noise.
    """

    exact: ClassVar[bool] = False
    speed: Positive

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return the stage that filters the speed."""
        return _low_pass(self.speed, period) if signal == "speed" else _unchanged

    def in_words(self) -> str:
        """Return a description of the filter, for messages and tables."""
        return f"speed filtered by a low-pass of {1000 * self.speed:g} ms"


def _late(samples: int) -> Stage:
    """Return a stage that delays a signal by a number of samples, starting with zeros."""
    waiting: Array | None = None

    def stage(values: Array) -> Array:
        nonlocal waiting
        before = np.zeros((samples, *values.shape[1:])) if waiting is None else waiting
        queue = np.concatenate([before, values])
        waiting = queue[len(values) :]
        return queue[: len(values)]

    return stage


def _added(noise: Array) -> Stage:
    """Return a stage that adds noise (N, R) to a signal, sample by sample."""
    done = 0

    def stage(values: Array) -> Array:
        nonlocal done
        first, done = done, done + len(values)
        return values + noise[first:done]

    return stage


def _low_pass(time_constant: float, period: float) -> Stage:
    """Return the low-pass stage f[k] = a f[k−1] + (1−a) s[k], with a = exp(−T/τ) and f[−1] = 0."""
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
    """Return (φ[k] − φ[k−1])/T [rad/s] for a sampled angle φ (N, ...) [rad]; 0 at k = 0."""
    return np.diff(angle, axis=0, prepend=angle[:1]) / period
