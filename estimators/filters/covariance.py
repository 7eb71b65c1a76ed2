"""Covariances, compiled: mixed and bounded. What is symmetric stays so to the last bit."""

import numpy as np

from flexaxis.estimators.models.compiler import fused, inlined


@fused
def merge(share, P, other, apart):
    """
    P ← (1−s) P + s P' + s (1−s) d dᵀ, the covariance of a mixture of two.

    Parameters
    ----------
    share : float
        s, the weight of the other.
    P, other : (m, w) arrays
    apart : (m,) array
        d, the difference of their means.
    """
    rest = 1.0 - share
    root = np.sqrt(share * rest)
    for a in range(len(apart)):
        for b in range(len(apart)):
            mine = rest * P[a, b] + share * other[a, b]
            P[a, b] = mine + (root * apart[a]) * (root * apart[b])


@inlined
def bound(P, ceiling):
    """Scale rows and columns of P (m, m) whose variance is above its ceiling (p,) down to it."""
    for i in range(len(ceiling)):
        if P[i, i] > ceiling[i]:
            factor = np.sqrt(ceiling[i] / P[i, i])
            for j in range(len(P)):
                P[i, j] *= factor
                P[j, i] *= factor


@inlined
def project(theta, lower, upper):
    """Put the first of θ back into the box."""
    for i in range(len(lower)):
        if theta[i] < lower[i]:  # not min and max, which would hide a NaN
            theta[i] = lower[i]
        elif theta[i] > upper[i]:
            theta[i] = upper[i]
