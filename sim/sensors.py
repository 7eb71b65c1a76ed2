"""What is measured of the truth: delay, noise, encoder counts, and the increment."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from flexaxis.sim.config import Config, NotNegative
from flexaxis.sim.timing import PERIOD

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
    """

    measurement: int = Field(default=0, ge=0, le=1000)


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


def delayed(signal: Array, samples: int) -> Array:
    """Return a signal (N, ...) late by whole samples, at rest (zero) before it began."""
    return np.concatenate([np.zeros_like(signal[:samples]), signal[: len(signal) - samples]])
