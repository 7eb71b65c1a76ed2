"""
Judge every time at which every parameter may have changed at once, to first order in the change.

A change δ of parameter i after sample k₀ adds δ ψ(k; k₀) to the output, where the sensitivity ψ
starts at zero at k₀. It is that of the whole stretch less what had built up until then,
ψ(k; k₀) = ψ(k) − c A^(k−1−k₀) z(k₀), so that all slopes Σψε and curvatures Σψ² follow from one
pass forwards, for ψ and z, and one backwards, for their sums with c A^m (the adjoint).
"""

import numpy as np

from flexaxis.estimators.sampling.compiler import compiled
from flexaxis.estimators.sampling.sampled import move, sample


@compiled
def screen(terms, theta, x, u, y, present, variance, lower, upper, spread):  # noqa: PLR0917
    """
    Return the best time of a change of each parameter, its size, and what it gains.

    Parameters
    ----------
    terms : flexaxis.estimators.sampling.sampled.Terms
        The model with all parameters.
    theta : (p,) array
        Parameters before any change.
    x : (n,) array
        State before the stretch.
    u, y : (N,) arrays
        Torque held after sample j, and the output one sample later.
    present : (N,) bool array
        Where y is measured.
    variance : float
        Of the output noise.
    lower, upper : (p,) arrays
        Where the parameters may be.
    spread : float
        Standard deviation of a change, before anything is measured, relative to the parameter.

    Returns
    -------
    onset : (p,) int array
        Sample of the stretch after which the parameter was different.
    change : (p,) array
        By how much.
    gain : (p,) array
        Logarithm of the evidence over that of no change [nats].
    """
    D = sample(terms, theta, np.arange(len(theta)))
    z, psi, epsilon = _forwards(D, x, u, y, present)
    N, p, n = len(u), len(theta), len(x)
    A, At, c = np.empty((n, n)), np.empty((n, n)), np.empty(n)
    for i in range(n):
        c[i] = D[0, n, i]
        for j in range(n):
            A[i, j] = At[j, i] = D[0, i, j]
    a, b, W = np.zeros((1, n)), np.zeros((p, n)), np.zeros((n, n))  # sums with c A^m
    next_a, next_b, next_W, half = (
        np.empty((1, n)),
        np.empty((p, n)),
        np.empty((n, n)),
        np.empty((n, n)),
    )
    slope, square = np.zeros(p), np.zeros(p)
    onset, change, gain = np.zeros(p, np.int64), np.zeros(p), np.full(p, -np.inf)
    for k in range(N - 1, -1, -1):
        _product(a, A, next_a)
        _product(b, A, next_b)
        _product(W, A, half)
        _product(At, half, next_W)
        a, next_a, b, next_b, W, next_W = next_a, a, next_b, b, next_W, W
        for j in range(n if present[k] else 0):
            a[0, j] += c[j] * epsilon[k]
            for m in range(n):
                W[j, m] += c[j] * c[m]
        for i in range(p):
            slope[i] += psi[k, i] * epsilon[k]
            square[i] += psi[k, i] ** 2
            g, H = slope[i], square[i]
            for j in range(n):
                b[i, j] += c[j] * psi[k, i]
                g -= a[0, j] * z[k, i, j]
                H -= 2 * b[i, j] * z[k, i, j]
                for m in range(n):
                    H += z[k, i, j] * W[j, m] * z[k, i, m]
            prior = 1 / (spread * theta[i]) ** 2
            g, H = g / variance, max(H, 0.0) / variance + prior
            delta = min(max(g / H, lower[i] - theta[i]), upper[i] - theta[i])
            gained = g * delta - (H * delta**2 + np.log(H / prior)) / 2
            if gained > gain[i]:
                onset[i], change[i], gain[i] = k, delta, gained
    return onset, change, gain


@compiled
def _forwards(D, x, u, y, present):
    """Return sensitivities z before each sample, and ψ and ε after it, zero in gaps."""
    N, p, n = len(u), len(D) - 1, len(x)
    z, psi, epsilon = np.zeros((N, p, n)), np.zeros((N, p)), np.zeros(N)
    X = np.zeros((1 + p, n + 1))
    for i in range(n):
        X[0, i] = x[i]
    moved = np.empty_like(X)
    for k in range(N):
        for i in range(p):
            for j in range(n):
                z[k, i, j] = X[1 + i, j]
        move(D, X, moved, u[k])
        X, moved = moved, X
        if present[k]:
            for i in range(p):
                psi[k, i] = X[1 + i, n]
            epsilon[k] = y[k] - X[0, n]
    return z, psi, epsilon


@compiled
def _product(F, G, H):
    """H ← F G, faster than a call of BLAS for matrices so small."""
    for i in range(F.shape[0]):
        for m in range(G.shape[1]):
            total = 0.0
            for j in range(F.shape[1]):
                total += F[i, j] * G[j, m]
            H[i, m] = total
