"""The small algebra of a fit, compiled: a step, its box, its prior, and what to solve for it."""

import numpy as np

from flexaxis.estimators.sampling.compiler import compiled


@compiled
def product(a, b):
    """Return aᵀb."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@compiled
def moved(theta, step, active, lower, upper):
    """Return θ with a step of some parameters, inside the box."""
    trial = np.empty(len(theta))
    for i in range(len(theta)):
        trial[i] = theta[i]
    for a in range(len(step)):
        i = active[a]
        trial[i] = min(max(theta[i] + step[a], lower[i]), upper[i])
    return trial


@compiled
def solve(H, g, damping, x):
    """
    Write x that solves (H + damping diag H) x = g for positive definite H; return log |…|.

    Cholesky's factorisation; LAPACK's takes ten seconds more to compile.
    """
    n = len(g)
    L, logarithm = np.empty((n, n)), 0.0
    for i in range(n):
        x[i] = g[i]
        for j in range(i + 1):
            L[i, j] = H[i, j] * (1.0 + damping) if i == j else H[i, j]
            for m in range(j):
                L[i, j] -= L[i, m] * L[j, m]
            if j < i:
                L[i, j] /= L[j, j]
                x[i] -= L[i, j] * x[j]
        L[i, i] = np.sqrt(L[i, i])
        x[i] /= L[i, i]
        logarithm += 2 * np.log(L[i, i])
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            x[i] -= L[j, i] * x[j]
        x[i] /= L[i, i]
    return logarithm


@compiled
def prior(theta, before, active, deviation, H, g):  # noqa: PLR0917
    """Add what is known of the change before the data to cost, curvature and slope."""
    cost = 0.0
    for a in range(len(active)):
        i = active[a]
        moved = (theta[i] - before[i]) / deviation[a]
        cost += moved**2
        H[a, a] += 1 / deviation[a] ** 2
        g[a] -= moved / deviation[a]
    return cost


@compiled
def put(a, b):
    """B ← a, element by element."""
    for i in range(len(a)):
        b[i] = a[i]
