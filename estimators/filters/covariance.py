"""
Covariances of ξ = [θ; x], compiled: over a sample, through a measurement, mixed and bounded.

P is (m, w) for p parameters and n states, m = p + n, with w from `padded`; what pads a row is zero.
In a sample θ stays and x moves, ξ⁺ = F ξ with F = [I 0; G], so that its block θθ only gains W.
X (> n, ≥ 1+m) has G behind its first lane, rows of no account below it, and in its last row h, the
derivative of the output. What is symmetric is computed once and stays so to the last bit.
"""

import numpy as np

from flexaxis.estimators.models.compiler import fused, inlined


def padded(m: int) -> int:
    """Return the length of the row of a covariance: whole registers of four."""
    return -4 * (-m // 4)


@fused
def look(X, P, Ph):
    """
    Write P h, and return hᵀPh.

    Parameters
    ----------
    X, P
        As above.
    Ph : (m,) array
    """
    m, spread = len(Ph), 0.0
    for a in range(m):
        Ph[a] = P[0, a] * X[-1, 1]
    for q in range(1, m):
        for a in range(m):
            Ph[a] += P[q, a] * X[-1, 1 + q]
    for a in range(m):
        spread += Ph[a] * X[-1, 1 + a]
    return spread


@fused
def carry(X, Ph, root, W, P, gain):  # noqa: PLR0917
    """
    Take P over a sample and through its measurement: P ← F P Fᵀ + W − k kᵀ, k = F P h·root.

    Parameters
    ----------
    X, Ph, P
        As for `look`.
    root : float
        1/√S of the innovation; 0 where there is no measurement.
    W : (p, p) array
        What the covariance of θ gains.
    gain : (m,) array
        k, written.
    """
    m, p = len(gain), len(W)
    G, GP = np.empty((m - p, m)), np.empty((m - p, m))
    for i in range(m - p):
        for b in range(m):
            G[i, b] = X[i, 1 + b]
            GP[i, b] = X[i, 1] * P[0, b]
        for q in range(1, m):  # whole rows at a time: their elements go side by side
            for b in range(m):
                GP[i, b] += X[i, 1 + q] * P[q, b]
        gain[p + i] = root * _dot(GP[i], X[-1, 1:])
    for a in range(p):
        gain[a] = root * Ph[a]
        for b in range(a + 1):
            P[a, b] = P[b, a] = P[a, b] + W[a, b] - gain[a] * gain[b]
    for i in range(m - p):
        a = p + i
        for b in range(p):
            P[a, b] = P[b, a] = GP[i, b] - gain[a] * gain[b]
        for j in range(i + 1):
            b = p + j
            P[a, b] = P[b, a] = _dot(GP[i], G[j]) - gain[a] * gain[b]


@fused
def _dot(a, b):
    """Return Σ a·b over the length of a."""
    total = 0.0
    for q in range(len(a)):
        total += a[q] * b[q]
    return total


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
