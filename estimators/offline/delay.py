"""A torque that acts late: the held torque that a model without delay has to be given."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from flexaxis.estimators.errors import EstimatorError

Array = NDArray[np.float64]


def delayed(u: ArrayLike, samples: float, *, smooth: bool = False) -> Array:
    """
    Return the mean torque (N,) that acts over each sample, when it acts late.

    A held torque u that is late by n + δ samples is u[k−n−1] for the first δ of sample k and
    u[k−n] for the rest: on average (1−δ) u[k−n] + δ u[k−n−1], which gives an inertia exactly the
    same speed at the end of the sample. Where u is a sequence of means of a smooth signal, such
    as a measured current, it is shifted along a cubic spline instead.

    Parameters
    ----------
    u : (N,) array_like
        Torque; before the first sample it is zero if held, and the first value if smooth.
    samples : float
        Delay in samples, any fraction of one; negative for a torque that acts early, of which the
        last value stays.
    smooth : bool
        Whether u comes from a smooth signal.

    Raises
    ------
    EstimatorError
        If the delay is not finite, or longer than the record.

    Examples
    --------
    >>> delayed([0.0, 4.0, 4.0, 0.0], 0.25)
    array([0., 3., 4., 1.])
    """
    u = np.asarray(u, float)
    if not abs(samples) < len(u):
        raise EstimatorError(
            f"delay is {samples} samples; it must be shorter than the record of {len(u)} samples"
        )
    if smooth:
        times = np.arange(len(u))
        return CubicSpline(times, u)(np.clip(times - samples, 0, len(u) - 1)) if samples else u
    whole, part = divmod(samples, 1)
    places = np.arange(len(u)) - int(whole)
    now, before = (np.where(k < 0, 0.0, u[np.minimum(k, len(u) - 1)]) for k in (places, places - 1))
    return (1 - part) * now + part * before


def delay_slope(u: ArrayLike, samples: float, *, smooth: bool = False) -> Array:
    """Return the derivative (N,) of `delayed` with respect to the delay, per sample."""
    step = 1e-4  # both cases are smooth over such a step, but for held torque at whole samples
    below = samples - step * (smooth or samples != 0)
    change = delayed(u, samples + step, smooth=smooth) - delayed(u, below, smooth=smooth)
    return change / (samples + step - below)
