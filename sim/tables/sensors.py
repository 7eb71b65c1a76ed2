"""Define the sensor tables: delay, noise, encoder and filter.

The method `stage` of a sensor table returns a function that processes a measured signal. The
attribute `exact` of a sensor table states whether the linear model also describes the processed
signal. A signal passes through all sensors in the order of the keys in `Scenario`. The log contains
the output of the last sensor. If `Scenario.feedback` is "measured", the controller reads the output
of the last sensor. Otherwise the controller reads the true motor angle.
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
"""Name of a measured motor signal: angle [rad] or speed [rad/s]."""

Stage = Callable[[Array], Array]
"""Type of a function that takes and returns the next n samples of a signal as an array (n, R)."""

White = Callable[[str], Array]
"""Type of a function that returns white noise with standard deviation 1, as an array (N, R).

The argument of the function is the purpose of the noise, for example "noise.speed".
"""


@runtime_checkable
class Sensor(Protocol):
    """Protocol of a sensor table; the method `stage` defines how the sensor processes a signal."""

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return a function that processes successive samples of a measured signal.

        Before the start of the run, the signal is assumed to be 0.
        """


def reading(sensors: Iterable[Sensor], signal: Signal, white: White, *, period: float) -> Stage:
    """Return a function that passes a signal through all given sensors in sequence.

    Parameters
    ----------
    sensors : iterable of Sensor
        Sensor tables in the order in which the sensors process the signal.
    signal : {"angle", "speed"}
        Signal to measure.
    white : callable
        Function that takes the purpose of the noise, such as "noise.speed", and returns white noise
        for the whole run.
    period : float
        Sampling period T [s].

    Returns
    -------
    callable
        Function that takes the next n samples of the true signal, as an array (n, R), and returns
        the measured samples. The measured samples are bitwise identical whether the function
        processes a whole run at once or sample by sample.
    """
    stages = [sensor.stage(signal, white, period) for sensor in sensors]
    return lambda values: reduce(lambda passed, stage: stage(passed), stages, values)


def _unchanged(values: Array) -> Array:
    return values


class NoiseConfig(Config):
    """The table ``[noise]`` of a scenario: standard deviations of white noise.

    Attributes
    ----------
    speed : float
        Standard deviation of the motor speed noise [rad/s].
    angle : float
        Standard deviation of the motor angle noise [rad]. The noise is added before the encoder
        rounds the angle.
    torque : float, optional
        Standard deviation of a white disturbance torque [N m]. The motor torque is the sum of
        command and disturbance, but the log contains only the command. Therefore the disturbance is
        an input error, unlike the sensor noise.
    """

    speed: NotNegative = 0.1
    angle: NotNegative = 0.0
    torque: Positive | None = None

    @property
    def exact(self) -> bool:
        """Whether the logged torque is equal to the torque that acts on the motor."""
        return self.torque is None

    def on_torque(self, white: White) -> Array | None:
        """Return the disturbance torque [N m], or None if there is no disturbance."""
        return self.torque * white("noise.torque") if self.torque else None

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return a function that adds noise to a measured signal."""
        deviation = self.speed if signal == "speed" else self.angle
        return _added(deviation * white(f"noise.{signal}")) if deviation else _unchanged

    def in_words(self) -> str:
        """Return a short description of the noise levels."""
        deviations = [(self.speed, "rad/s on the speed"), (self.angle, "rad on the angle"),
                 (self.torque, "N m on the acting torque")]  # fmt: skip
        return "; ".join(f"noise of {value:g} {words}" for value, words in deviations if value)


class EncoderConfig(Config):
    """The table ``[encoder]`` of a scenario: resolution of the measured motor angle.

    Attributes
    ----------
    counts : int
        Number of encoder counts per motor revolution. An encoder with 16 bits has 65536 counts. If
        `counts` is 0, the encoder does not quantize the angle.
    """

    exact: ClassVar[bool] = True  # the bounds include the rounding of the encoder
    counts: int = Field(default=0, ge=0)

    @field_validator("counts")
    @classmethod
    def _counts_and_not_bits(cls, counts: int) -> int:
        if 0 < counts < 64:
            raise ValueError(
                f"{counts} counts per revolution are too few for control; if you meant {counts} "
                f"bits, give {2**counts} counts"
            )
        return counts

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return a function that rounds the motor angle to the nearest encoder count."""
        if signal != "angle" or not self.counts:
            return _unchanged
        step = 2 * math.pi / self.counts
        return lambda values: np.rint(values / step) * step

    def in_words(self) -> str:
        """Return a short description of the encoder resolution."""
        return f"encoder of {self.counts} counts" if self.counts else ""


class DelayConfig(Config):
    """The table ``[delay]`` of a scenario: delays of the signals.

    Attributes
    ----------
    measurement : int
        Delay of the measured angle and speed [samples].
    torque : float, optional
        Delay from a torque command to the motor torque [s], which must be a multiple of 1 ms. The
        log contains the torque command without this delay.
    """

    measurement: int = Field(default=0, ge=0, le=1000)
    torque: Annotated[float, Field(gt=0, le=0.1)] | None = None

    @field_validator("torque")
    @classmethod
    def _whole_ticks(cls, torque: float | None) -> float | None:
        if torque and abs(torque / TICK - round(torque / TICK)) > 1e-6:
            raise ValueError(f"the torque delay must be a multiple of {TICK:g} s, not {torque:g}")
        return torque

    @property
    def exact(self) -> bool:
        """Whether the scenario has neither a measurement delay nor a torque delay."""
        return not (self.measurement or self.torque)

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return a function that delays a measured signal."""
        return _late(self.measurement) if self.measurement else _unchanged

    def in_words(self) -> str:
        """Return a short description of the signal delays."""
        words = [f"measurement delayed by {self.measurement} samples"] if self.measurement else []
        words += [f"torque delayed by {1000 * self.torque:g} ms"] if self.torque else []
        return "; ".join(words)

    @property
    def torque_ticks(self) -> int:
        """Torque delay in milliseconds."""
        return round((self.torque or 0.0) / TICK)


class FilterConfig(Config):
    """The table ``[filter]`` of a scenario: low-pass filter of the logged speed.

    Attributes
    ----------
    speed : float
        Time constant of the first-order low-pass filter for the measured speed [s]. The input of
        the filter is the sum of motor speed and noise.
    """

    exact: ClassVar[bool] = False
    speed: Positive

    def stage(self, signal: Signal, white: White, period: float) -> Stage:
        """Return a function that filters the measured speed."""
        return _low_pass(self.speed, period) if signal == "speed" else _unchanged

    def in_words(self) -> str:
        """Return a short description of the speed filter."""
        return f"speed filter with a time constant of {1000 * self.speed:g} ms"


def _late(samples: int) -> Stage:
    """Return a function that delays a signal by a number of samples; the first outputs are 0."""
    waiting: Array | None = None

    def stage(values: Array) -> Array:
        nonlocal waiting
        before = np.zeros((samples, *values.shape[1:])) if waiting is None else waiting
        queue = np.concatenate([before, values])
        waiting = queue[len(values) :]
        return queue[: len(values)]

    return stage


def _added(noise: Array) -> Stage:
    """Return a function that adds the array `noise` (N, R) to a signal, sample by sample."""
    done = 0

    def stage(values: Array) -> Array:
        nonlocal done
        first, done = done, done + len(values)
        return values + noise[first:done]

    return stage


def _low_pass(time_constant: float, period: float) -> Stage:
    """Return a function that applies a first-order low-pass filter to a signal."""
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
    """Return the angle increments (φ[k] − φ[k−1])/T [rad/s]; the first increment is 0."""
    return np.diff(angle, axis=0, prepend=angle[:1]) / period
