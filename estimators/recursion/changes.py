"""Which single parameter explains best how estimates have changed, and by how much it changed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Z95 = 1.96  # standard deviations on both sides that hold 95 %


@dataclass(frozen=True)
class Change:
    """
    A change of one parameter.

    Attributes
    ----------
    index : int
    gain : float
        Twice the evidence for it against none: χ² with one degree of freedom if there is none.
    size, deviation : float
        How much it changed, and the standard deviation of that.
    """

    index: int
    gain: float
    size: float
    deviation: float


def single_change(difference: Array, covariance: Array) -> Change:
    """
    Return the parameter whose change alone explains a difference of estimates best.

    With d = a e_i + v, cov v = C: a = e_iᵀC⁻¹d/e_iᵀC⁻¹e_i, and what it explains of dᵀC⁻¹d is
    (e_iᵀC⁻¹d)²/e_iᵀC⁻¹e_i, the generalised least squares for each i.

    Parameters
    ----------
    difference : (q,) array
    covariance : (q, q) array
    """
    if not np.isfinite(difference).all() or not np.isfinite(covariance).all():
        return Change(0, 0.0, np.nan, np.inf)  # a filter that diverges is a result
    free = np.flatnonzero(np.diag(covariance) > 0)  # what is fixed explains nothing
    scale = np.sqrt(np.diag(covariance)[free])
    information = np.linalg.pinv(
        covariance[np.ix_(free, free)] / np.outer(scale, scale), hermitian=True
    )
    score, weight = information @ (difference[free] / scale), np.diag(information)
    gains = score**2 / weight
    best = int(np.argmax(gains))
    return Change(
        int(free[best]),
        float(gains[best]),
        float(score[best] / weight[best] * scale[best]),
        float(scale[best] / np.sqrt(weight[best])),
    )
