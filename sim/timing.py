"""The sampling grid of a run: t_k = k T."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

PERIOD = 0.005
"""Sampling period T of a scenario that does not say [s]."""

SHORTEST, LONGEST = 0.001, 0.01
"""Periods that a scenario may have [s].

A sample shorter than the engine's step of 1 ms tells nothing new of the linear axis; with one of
more than 10 ms the modes of the nominal axes, at up to 24 Hz, come near half the sampling rate.
"""

TICK = 0.001
"""What goes on between samples goes by ticks of this length [s]: an inner loop, a short delay."""


def rate(period: float) -> int:
    """Return the samples per second."""
    return round(1 / period)


def sample_index(time: float, period: float) -> int:
    """Return the number of the sample nearest to a time [s]."""
    return round(time * rate(period))


@dataclass(frozen=True, eq=False)
class Grid:
    """Samples of a run, at which time-varying values are evaluated.

    Attributes
    ----------
    k : ndarray (M,) of int
        Numbers of the samples.
    period : float
        Sampling period T [s]; its inverse is a whole number.
    """

    k: NDArray[np.int64]
    period: float

    @classmethod
    def first(cls, samples: int, period: float) -> Grid:
        """Return the first samples of a run."""
        return cls(np.arange(samples), period)

    @property
    def times(self) -> NDArray[np.float64]:
        """Times (M,) of the samples [s].

        A quotient rather than a multiple of T: so ``Grid.first(N, .005).times[2060]`` is the
        float ``10.3``.
        """
        return self.k / rate(self.period)

    def index(self, time: float) -> int:
        """Return the number of the sample nearest to a time [s]."""
        return sample_index(time, self.period)


def checked_period(period: float) -> float:
    """Return a sampling period [s]; raise a ValueError if it is invalid.

    Examples
    --------
    >>> checked_period(0.0025)
    0.0025
    """
    if not SHORTEST <= period <= LONGEST:
        raise ValueError(f"must be from {SHORTEST:g} to {LONGEST:g} s, not {period:g}")
    if abs(1 / period - rate(period)) > 1e-6:
        raise ValueError(
            f"must go into one second a whole number of times, such as {1 / rate(period):.6g} "
            f"({rate(period)} Hz), not {period:g}"
        )
    return period
