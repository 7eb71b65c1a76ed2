"""
Explain a stretch of data by a change of some parameters at a known time.

The state at the change is known, so the sensitivities start there at zero, as in the oracle
Cramér–Rao bound. Levenberg–Marquardt, and Laplace's approximation of the evidence
(D. J. C. MacKay, *Information Theory, Inference, and Learning Algorithms*, ch. 27–28).
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from flexaxis.estimators.sampled import sample

Array = NDArray[np.float64]

TRIALS = 6  # steps of the onset by one sample, at most
ITERATIONS = 8  # of one fit, at most
CONVERGED = 0.02  # nats that a further step would gain
WIDEST, NARROWEST = 1e6, 1e-6  # damping


class Past(NamedTuple):
    """
    What a filter knew at some samples in a row, and what was measured from the first on.

    Attributes
    ----------
    theta : (m, p) array
        All parameters, at each sample at which a change may have happened.
    x : (m, n) array
        State.
    likelihood : (m,) array
        Logarithm of the likelihood of the filter up to there [nats].
    u, y : (N,) arrays
        Torque held after sample j of these, and the output one sample later; N ≥ m.
    present : (N,) bool array
        Where y is measured.
    variance : float
        Of the output noise, before any change.
    """

    theta: Array
    x: Array
    likelihood: Array
    u: Array
    y: Array
    present: NDArray[np.bool_]
    variance: float


class Change(NamedTuple):
    """
    A change that was fitted.

    Attributes
    ----------
    onset : int
        Sample of the past after which the parameters were different.
    theta : (p,) array
        All parameters, after the change.
    evidence : float
        Logarithm of the probability of all data, but for a constant [nats].
    unexplained : float
        Mean square of the residual over the variance of the noise; one if all is explained.
    """

    onset: int
    theta: Array
    evidence: float
    unexplained: float


@njit(cache=True, nogil=True, error_model="numpy")
def explain(terms, past, active, lower, upper, spread, guess, theta, offsets):  # noqa: PLR0917
    """
    Fit a change of some parameters, and its time, to the past; all others stay as they were.

    Parameters
    ----------
    terms : flexaxis.estimators.sampled.Terms
        The model with all parameters.
    past : Past
    active : (q,) int array
        Parameters that may have changed.
    lower, upper : (p,) arrays
        Where the parameters may be.
    spread : float
        Standard deviation of a change, before anything is measured, relative to the parameter.
    guess : int
        Sample of the past to start from.
    theta : (p,) array
        Parameters after the change to start from.
    offsets : (m,) int array
        Other samples to start from, counted from the guess. The misfit has local minima in time.

    Returns
    -------
    Change
    """
    best, latest = guess, len(past.theta) - 1
    start = theta.copy()
    theta, evidence, misfit = _at(terms, past, active, lower, upper, spread, best, start)
    for offset in offsets:
        if 0 <= guess + offset <= latest:
            found = _at(terms, past, active, lower, upper, spread, guess + offset, start)
            if found[1] > evidence:
                best, (theta, evidence, misfit) = guess + offset, found
    for direction in (-1, 1):
        for _ in range(TRIALS):
            if not 0 <= best + direction <= latest:
                break
            found = _at(terms, past, active, lower, upper, spread, best + direction, theta)
            if found[1] <= evidence:
                break
            best, (theta, evidence, misfit) = best + direction, found
    return Change(best, theta, evidence, misfit / max(np.sum(past.present[best:]), 1))


@njit(cache=True, nogil=True, error_model="numpy")
def _at(terms, past, active, lower, upper, spread, onset, start):  # noqa: PLR0917
    """Fit a change at a known sample; return θ, evidence and misfit Σε²/σ²."""
    before = past.theta[onset]
    theta, evidence, misfit = _refit(
        terms,
        before,
        start,
        past.x[onset],
        past.u[onset:],
        past.y[onset:],
        past.present[onset:],
        past.variance,
        active,
        lower,
        upper,
        spread * np.abs(before),
    )
    return theta, past.likelihood[onset] + evidence, misfit


@njit(cache=True, nogil=True, error_model="numpy")
def _refit(terms, before, start, x, u, y, present, variance, active, lower, upper, spread):  # noqa: PLR0917
    q = len(active)
    theta = before.copy()
    for i in active:
        theta[i] = start[i]
    misfit, H, g = _normal_equations(terms, theta, x, u, y, present, variance, active)
    cost = misfit + _prior(theta, before, active, spread, H, g)
    damping = 1e-3
    for _ in range(ITERATIONS if q else 0):
        damped = H.copy()
        for a in range(q):
            damped[a, a] += damping * H[a, a]
        step = np.linalg.solve(damped, g)
        trial = theta.copy()
        for a in range(q):
            i = active[a]
            trial[i] = min(max(theta[i] + step[a], lower[i]), upper[i])
        fit, H_trial, g_trial = _normal_equations(terms, trial, x, u, y, present, variance, active)
        tried = fit + _prior(trial, before, active, spread, H_trial, g_trial)
        if tried < cost:
            gained = cost - tried
            theta, misfit, cost, H, g = trial, fit, tried, H_trial, g_trial
            damping = max(damping / 10, NARROWEST)
            if gained < CONVERGED:
                break
        else:
            damping *= 10
            if damping > WIDEST or np.dot(step, g) < CONVERGED:
                break
    evidence = -cost / 2
    if q:
        scaled = H.copy()
        for a in range(q):
            for b in range(q):
                scaled[a, b] *= spread[active[a]] * spread[active[b]]
        evidence -= np.log(np.linalg.det(scaled)) / 2
    return theta, evidence, misfit


@njit(cache=True, nogil=True, error_model="numpy")
def _prior(theta, before, active, spread, H, g):  # noqa: PLR0917
    """Add what is known of the change before the data to cost, curvature and slope."""
    cost = 0.0
    for a in range(len(active)):
        i = active[a]
        moved = (theta[i] - before[i]) / spread[i]
        cost += moved**2
        H[a, a] += 1 / spread[i] ** 2
        g[a] -= moved / spread[i]
    return cost


@njit(cache=True, nogil=True, error_model="numpy")
def _normal_equations(terms, theta, x, u, y, present, variance, active):  # noqa: PLR0917
    """Return Σε²/σ², Σψψᵀ/σ² and Σψε/σ² over the stretch."""
    D = sample(terms, theta, active)
    n, q = terms.n, len(active)
    X = np.zeros((1 + q, n + 1))
    X[0, :n] = x
    moved = np.empty_like(X)
    H, g, misfit = np.zeros((q, q)), np.zeros(q), 0.0
    for k in range(len(u)):
        _move(D, X, moved, u[k])
        X, moved = moved, X
        if present[k]:
            epsilon = y[k] - X[0, n]
            misfit += epsilon**2
            for a in range(q):
                g[a] += X[1 + a, n] * epsilon
                for b in range(a + 1):
                    H[a, b] += X[1 + a, n] * X[1 + b, n]
    for a in range(q):
        for b in range(a):
            H[b, a] = H[a, b]
    return misfit / variance, H / variance, g / variance


@njit(cache=True, nogil=True, error_model="numpy")
def _move(D, X, moved, u):
    """Take states and sensitivities [x; y] over one sample; the place of y lends itself to u."""
    size = X.shape[1]
    X[0, size - 1] = u
    for a in range(1, len(X)):
        X[a, size - 1] = 0.0
    for i in range(size):
        total = 0.0
        for j in range(size):
            total += D[0, i, j] * X[0, j]
        moved[0, i] = total
        for a in range(1, len(X)):
            total = 0.0
            for j in range(size):
                total += D[0, i, j] * X[a, j] + D[a, i, j] * X[0, j]
            moved[a, i] = total


@njit(cache=True, nogil=True, error_model="numpy")
def replay(terms, theta, X, P, u, y, present, forgetting):  # noqa: PLR0917
    """
    Run least squares around a fixed θ over a stretch: the filter as if it had known θ all along.

    Parameters
    ----------
    terms : Terms
    theta : (p,) array
        What the model is linearised at.
    X : (1+p, n+1) array
        State, and its sensitivities, at the start; overwritten by those at the end.
    P : (p, p) array
        At the start, for a noise variance of one; overwritten.
    u, y, present
        As in `Past`.
    forgetting : float
        λ.

    Returns
    -------
    (p,) array
        What the data add to θ, eq. (5)–(9) with ε = y − ŷ(θ) − ψᵀδ; zero where P is.
    """
    p = len(theta)
    D = sample(terms, theta, np.arange(p))
    n = terms.n
    moved = np.empty_like(X)
    ahead = X
    delta, gain = np.zeros(p), np.empty(p)
    for k in range(len(u)):
        _move(D, ahead, moved, u[k])
        ahead, moved = moved, ahead
        P /= forgetting
        if present[k]:
            s, epsilon = 1.0, y[k] - ahead[0, n]
            for i in range(p):
                gain[i] = 0.0
                for j in range(p):
                    gain[i] += P[i, j] * ahead[1 + j, n]
                s += gain[i] * ahead[1 + i, n]
                epsilon -= ahead[1 + i, n] * delta[i]
            for i in range(p):
                delta[i] += gain[i] * epsilon / s
                for j in range(i + 1):
                    P[i, j] -= gain[i] * gain[j] / s
                    P[j, i] = P[i, j]
    X[:] = ahead
    return delta
