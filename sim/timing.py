"""The sampling grid that everything in a run lies on: t_k = k T, T = 1/200 s."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

RATE = 200
"""Samples per second."""

PERIOD = 1 / RATE
"""Sampling period T [s]."""

TICKS = 5
"""Ticks of 1 ms in a sample, for what goes on between samples: an inner loop, a short delay."""


def sample_index(time: float) -> int:
    """Return the number of the sample nearest to a time [s]."""
    return round(time * RATE)


def sample_indices(times: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the numbers of the samples nearest to times (M,) [s]."""
    return np.rint(np.asarray(times) * RATE).astype(np.int64)


def sample_times(samples: int) -> NDArray[np.float64]:
    """Return the times (samples,) [s] of the first samples.

    A quotient rather than a multiple of T: so ``sample_times(N)[2060]`` is the float ``10.3``.
    """
    return np.arange(samples) / RATE
