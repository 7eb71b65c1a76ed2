"""Compute the sampling times t_k = k T of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

PERIOD = 0.005
"""Default sampling period T [s]."""

SHORTEST, LONGEST = 0.001, 0.01
"""Shortest and longest sampling period that a scenario can have [s].

The shortest sampling period is equal to the simulation step of the physics engine. If the sampling
period were longer than 10 ms, half the sampling rate would be too close to the natural frequencies
of the axes (up to 24 Hz).
"""

TICK = 0.001
"""Sampling period of inner control loops, and resolution of torque delays [s]."""


def rate(period: float) -> int:
    """Return the sampling rate [Hz], given the sampling period [s]."""
    return round(1 / period)


def sample_index(time: float, period: float) -> int:
    """Return the index of the sample that is closest to a time [s]."""
    return round(time * rate(period))


@dataclass(frozen=True, eq=False)
class Grid:
    """Sampling instants of a run, at which parameters and references are evaluated.

    Attributes
    ----------
    k : ndarray (M,) of int
        Indices of the samples.
    period : float
        Sampling period T [s]; the sampling rate 1/T is an integer.
    """

    k: NDArray[np.int64]
    period: float

    @classmethod
    def first(cls, samples: int, period: float) -> Grid:
        """Return a grid that begins at the start of a run and has the given number of samples."""
        return cls(np.arange(samples), period)

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the samples [s], as an array (M,).

        The times are computed as k divided by the sampling rate, because k times T would have
        rounding errors. Therefore ``Grid.first(N, 0.005).times[2060]`` is exactly the float
        ``10.3``.
        """
        return self.k / rate(self.period)

    def index(self, time: float) -> int:
        """Return the index of the sample that is closest to a time [s]."""
        return sample_index(time, self.period)


def checked_period(period: float) -> float:
    """Return the sampling period [s] if it is valid; otherwise raise a ValueError.

    Examples
    --------
    >>> checked_period(0.0025)
    0.0025
    """
    if not SHORTEST <= period <= LONGEST:
        raise ValueError(
            f"the sampling period must be between {SHORTEST:g} and {LONGEST:g} s, not {period:g}"
        )
    if abs(1 / period - rate(period)) > 1e-6:
        raise ValueError(
            f"one second must be a multiple of the sampling period: use {1 / rate(period):.6g} s "
            f"({rate(period)} Hz), not {period:g}"
        )
    return period
