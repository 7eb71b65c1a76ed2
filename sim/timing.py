"""Compute the sampling times t_k = k T of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

PERIOD = 0.005
"""Default sampling period T [s]."""

SHORTEST, LONGEST = 0.001, 0.01
"""Limits of the sampling period of a scenario [s].

A sampling period below the engine's step of 1 ms adds no information about the linear axis. With a
sampling period above 10 ms, the natural frequencies of the nominal axes (up to 24 Hz) are close to
half the sampling rate.
"""

TICK = 0.001
"""Period of inner control loops and resolution of torque delays [s]."""


def rate(period: float) -> int:
    """Return the number of samples per second, given the sampling period [s]."""
    return round(1 / period)


def sample_index(time: float, period: float) -> int:
    """Return the index of the sample nearest to a time [s]."""
    return round(time * rate(period))


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid of samples at which time-varying parameters and references are evaluated.

    Attributes
    ----------
    k : ndarray (M,) of int
        Indices of the samples.
    period : float
        Sampling period T [s]; 1/T is an integer.
    """

    k: NDArray[np.int64]
    period: float

    @classmethod
    def first(cls, samples: int, period: float) -> Grid:
        """Return the grid of the first `samples` samples of a run."""
        return cls(np.arange(samples), period)

    @property
    def times(self) -> NDArray[np.float64]:
        """Times (M,) of the samples [s].

        The method divides k by the sampling rate instead of multiplying k by T. As a result,
        ``Grid.first(N, 0.005).times[2060]`` is exactly the float ``10.3``.
        """
        return self.k / rate(self.period)

    def index(self, time: float) -> int:
        """Return the index of the sample nearest to a time [s]."""
        return sample_index(time, self.period)


def checked_period(period: float) -> float:
    """Return a sampling period [s], or raise a ValueError if the period is invalid.

    Examples
    --------
    >>> checked_period(0.0025)
    0.0025
    """
    if not SHORTEST <= period <= LONGEST:
        raise ValueError(f"must be from {SHORTEST:g} to {LONGEST:g} s, not {period:g}")
    if abs(1 / period - rate(period)) > 1e-6:
        raise ValueError(
            f"one second must be a whole number of periods: use {1 / rate(period):.6g} "
            f"({rate(period)} Hz), not {period:g}"
        )
    return period
