"""
Judge every time at which every parameter may have changed at once, to first order in the change.

A change δ of parameter i after sample k₀ adds δ ψ(k; k₀) to the output, where the sensitivity ψ
starts at zero at k₀. It is that of the whole stretch less what had built up until then,
ψ(k; k₀) = ψ(k) − c_k F_(k−1) … F_k₀ z(k₀), where F_k and c_k are the derivatives of state and
output after sample k by the state before it, along the trajectory: constant for a linear model, but
not where friction acts. So all slopes Σψε and curvatures Σψ² follow from one pass forwards, for ψ,
z, F and c, and one backwards, for their sums with c_k F_(k−1) … (the adjoint).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.follow import follow
from flexaxis.estimators.relocate.work import CALL, Work, of_sample, samples_of, to_begin
from flexaxis.estimators.sampling.compiler import compiled
from flexaxis.estimators.sampling.prepared import Prepared, copy, prepare
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]


class Ahead(NamedTuple):
    """What is known of N samples forwards, and room for it: see the arrays of `_start`."""

    prepared: Prepared
    X: Array
    moved: Array
    z: Array
    psi: Array
    epsilon: Array
    F: Array
    c: Array


class Back(NamedTuple):
    """Sums of ε, ψ and c with c F … F, those of ψε and ψ², and what `screen` returns."""

    a: Array
    b: Array
    W: Array
    slope: Array
    square: Array
    onset: NDArray[np.int64]
    change: Array
    gain: Array


@compiled
def screen(terms, theta, active, x, u, y, present, variance, lower, upper, spread):  # noqa: PLR0917
    """
    Return the best time of a change of each parameter, its size, and what it gains.

    Parameters
    ----------
    terms : flexaxis.estimators.sampling.sampled.Terms
        The model with all parameters.
    theta : (p,) array
        Parameters before any change.
    active : (q,) int array
        Those that may have changed.
    x : (n,) array
        State before the stretch.
    u : (N, 2) array
        Torque held after sample j, and the motor angle at it.
    y : (N,) array
        The output one sample later.
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
    onset : (q,) int array
        Sample of the stretch after which the parameter was different.
    change : (q,) array
        By how much.
    gain : (q,) array
        Logarithm of the evidence over that of no change [nats].
    """
    N = len(u)
    ahead = _start(terms, theta, active, x, N)
    _forwards(ahead, u, y, present, 0, N)
    back = _end(ahead)
    _backwards(ahead, back, theta, active, present, variance, lower, upper, spread, N, 0)
    return back.onset, back.change, back.gain


def screening(  # noqa: PLR0917
    terms: Terms,
    theta: Array,
    active: NDArray[np.int64],
    x: Array,
    u: Array,
    y: Array,
    present: NDArray[np.bool_],
    variance: float,
    lower: Array,
    upper: Array,
    spread: float,
    *,
    grain: float,
) -> Work[tuple[NDArray[np.int64], Array, Array]]:
    """Do as `screen`, in pieces of so many operations."""
    N, p, n = len(u), len(active), len(x)
    cost = of_sample(terms, 1 + p + n)
    samples = samples_of(grain, cost)
    yield to_begin(terms, 1 + p + n) + N * n * (p + n)
    ahead = _start(terms, theta, active, x, N)
    for first in range(0, N, samples):
        yield CALL + cost * min(samples, N - first)
        _forwards(ahead, u, y, present, first, min(first + samples, N))
    cost = n * n * (3 * n + 2 * p)
    samples = samples_of(grain, cost)
    back = _end(ahead)
    for last in range(N, 0, -samples):
        yield CALL + cost * min(samples, last)
        first = max(last - samples, 0)
        judged = active, present, variance, lower, upper, spread
        _backwards(ahead, back, theta, *judged, last, first)
    return back.onset, back.change, back.gain


@compiled
def _start(terms, theta, active, x, N):
    """Return `Ahead` before the first of N samples."""
    p, n = len(active), len(x)
    prepared = prepare(terms, theta, active, n)
    X = np.zeros((1 + p + n, n + 1))  # the last n rows: by the state before the sample
    for i in range(n):
        X[0, i] = x[i]
    z, psi, epsilon = np.zeros((N, p, n)), np.zeros((N, p)), np.zeros(N)
    F, c = np.empty((N, n, n)), np.empty((N, n))
    return Ahead(prepared, X, np.empty_like(X), z, psi, epsilon, F, c)


@compiled
def _forwards(ahead, u, y, present, first, last):  # noqa: PLR0917
    """Write z before each sample; ψ, ε (zero in gaps), F and c over it."""
    prepared, X, moved, z, psi, epsilon, F, c = ahead
    p, n = psi.shape[1], F.shape[1]
    for k in range(first, last):
        for i in range(p):
            for j in range(n):
                z[k, i, j] = X[1 + i, j]
        for i in range(n):
            for j in range(n):
                X[1 + p + i, j] = 1.0 if i == j else 0.0
        follow(prepared, X, moved, u[k])
        X, moved = moved, X
        for j in range(n):
            c[k, j] = X[1 + p + j, n]
            for i in range(n):
                F[k, i, j] = X[1 + p + j, i]
        if present[k]:
            for i in range(p):
                psi[k, i] = X[1 + i, n]
            epsilon[k] = y[k] - X[0, n]
    if (last - first) % 2:  # the two rooms have changed places
        copy(X, ahead.X)


@compiled
def _end(ahead):
    """Return `Back` after the last sample."""
    p, n = ahead.z.shape[1:]
    sums = np.zeros((1, n)), np.zeros((p, n)), np.zeros((n, n))
    found = np.zeros(p, np.int64), np.zeros(p), np.full(p, -np.inf)
    return Back(*sums, np.zeros(p), np.zeros(p), *found)


@compiled
def _backwards(  # noqa: PLR0917
    ahead, sums, theta, active, present, variance, lower, upper, spread, last, first
):
    """Write onset, change and gain of `screen`."""
    z, psi, epsilon, F, c = ahead[3:]
    slope, square, onset, change, gain = sums[3:]
    p, n = z.shape[1:]
    back = sums.a, sums.b, sums.W
    room = np.empty((1, n)), np.empty((p, n)), np.empty((n, n))
    half, Ft = np.empty((n, n)), np.empty((n, n))
    for k in range(last - 1, first - 1, -1):
        for i in range(n):
            for j in range(n):
                Ft[j, i] = F[k, i, j]
        _product(back[0], F[k], room[0])
        _product(back[1], F[k], room[1])
        _product(back[2], F[k], half)
        _product(Ft, half, room[2])
        copy(room[0], back[0])
        copy(room[1], back[1])
        copy(room[2], back[2])
        a, b, W = back
        for j in range(n if present[k] else 0):
            a[0, j] += c[k, j] * epsilon[k]
            for m in range(n):
                W[j, m] += c[k, j] * c[k, m]
        for i in range(p):
            slope[i] += psi[k, i] * epsilon[k]
            square[i] += psi[k, i] ** 2
            g, H = slope[i], square[i]
            for j in range(n):
                b[i, j] += c[k, j] * psi[k, i]
                g -= a[0, j] * z[k, i, j]
                H -= 2 * b[i, j] * z[k, i, j]
                for m in range(n):
                    H += z[k, i, j] * W[j, m] * z[k, i, m]
            here, low, high = theta[active[i]], lower[active[i]], upper[active[i]]
            prior = 1 / (spread * here) ** 2
            g, H = g / variance, max(H, 0.0) / variance + prior
            delta = min(max(g / H, low - here), high - here)
            gained = g * delta - (H * delta**2 + np.log(H / prior)) / 2
            if gained > gain[i]:
                onset[i], change[i], gain[i] = k, delta, gained


@compiled
def _product(F, G, H):
    """H ← F G, faster than a call of BLAS for matrices so small."""
    for i in range(F.shape[0]):
        for m in range(G.shape[1]):
            total = 0.0
            for j in range(F.shape[1]):
                total += F[i, j] * G[j, m]
            H[i, m] = total
