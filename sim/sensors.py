"""What is measured of the truth: delay, noise, encoder counts, filter, and the increment."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator
from scipy.signal import lfilter

from flexaxis.sim.config import Config, NotNegative, Positive
from flexaxis.sim.timing import PERIOD, TICKS

Array = NDArray[np.float64]


class NoiseConfig(Config):
    """White measurement noise; the table ``[noise]`` of a scenario.

    Attributes
    ----------
    speed : float
        Standard deviation on the motor speed [rad/s].
    angle : float
        Standard deviation on the motor angle, before the encoder rounds it [rad].
    """

    speed: NotNegative = 0.1
    angle: NotNegative = 0.0


class EncoderConfig(Config):
    """Resolution of the motor angle; the table ``[encoder]`` of a scenario.

    Attributes
    ----------
    counts : int
        Counts per revolution of the motor (65536 for 16 bits); 0 is an ideal encoder.
    """

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
        if torque and abs(torque * TICKS / PERIOD - round(torque * TICKS / PERIOD)) > 1e-6:
            raise ValueError(f"must be a multiple of {PERIOD / TICKS:g} s, not {torque:g}")
        return torque

    @property
    def torque_ticks(self) -> int:
        """Delay of the torque in ticks of 1 ms."""
        return round((self.torque or 0.0) * TICKS / PERIOD)


class FilterConfig(Config):
    """What the drive does to the speed before it is logged; the table ``[filter]``.

    Attributes
    ----------
    speed : float
        Time constant of a first-order low-pass on the measured speed, noise and all [s].
    """

    speed: Positive


def measured_angle(angle: Array, noise: Array | float, *, counts: int) -> Array:
    """Return what an encoder reads: the nearest count of the angle with noise.

    Parameters
    ----------
    angle, noise : ndarray
        True angle and noise on it [rad], of one shape.
    counts : int
        Counts per revolution; 0 rounds nothing.

    Returns
    -------
    ndarray
        Measured angle [rad].
    """
    if not counts:
        return angle + noise
    step = 2 * math.pi / counts
    return np.rint((angle + noise) / step) * step


def angle_increment(angle: Array, *, period: float = PERIOD) -> Array:
    """Return the rate (φ[k] − φ[k−1])/T of a sampled angle (N, ...) [rad/s], 0 at k = 0."""
    return np.diff(angle, axis=0, prepend=angle[:1]) / period


def low_passed(signal: Array, time_constant: float, *, period: float = PERIOD) -> Array:
    """Return a signal (N, ...) through f[k] = a f[k−1] + (1−a) s[k], a = exp(−T/τ), from rest."""
    pole = math.exp(-period / time_constant)
    return np.asarray(lfilter([1 - pole], [1, -pole], signal, axis=0))


def delayed(signal: Array, samples: int) -> Array:
    """Return a signal (N, ...) late by whole samples, at rest (zero) before it began."""
    return np.concatenate([np.zeros_like(signal[:samples]), signal[: len(signal) - samples]])
