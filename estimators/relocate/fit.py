"""
Explain a stretch of data by a change of some parameters at a known time.

The state at the change is known, so the sensitivities start there at zero, as in the oracle
Cramér–Rao bound. Levenberg–Marquardt, and Laplace's approximation of the evidence
(D. J. C. MacKay, *Information Theory, Inference, and Learning Algorithms*, ch. 27–28).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.follow import follow
from flexaxis.estimators.sampling.compiler import compiled
from flexaxis.estimators.sampling.prepared import prepare
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]

TRIALS = 2  # steps of the onset by one sample, at most
ITERATIONS = 5  # of one fit, at most
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
    u : (N, 2) array
        Torque held after sample j of these, and the motor angle at it; N ≥ m.
    y : (N,) array
        The output one sample later.
    present : (N,) bool array
        Where y is measured.
    epsilon : (m + ORDER,) array
        Residual of the filter, from ``ORDER`` samples before the first on; zero where y is missing.
    colour : (ORDER,) array
        Weights of the last residuals in the prediction of the next, latest first.
    variance : float
        Of what that leaves of the residual, before any change.
    """

    theta: Array
    x: Array
    likelihood: Array
    u: Array
    y: Array
    present: NDArray[np.bool_]
    epsilon: Array
    colour: Array
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


def explain(  # noqa: PLR0917
    terms: Terms,
    past: Past,
    active: NDArray[np.int64],
    lower: Array,
    upper: Array,
    spread: float,
    guess: int,
    theta: Array,
) -> Change:
    """
    Fit a change of some parameters, and its time, to the past; all others stay as they were.

    Parameters
    ----------
    terms : Terms
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
    """
    return Change(*_explain(terms, past, active, lower, upper, spread, guess, theta))


@compiled
def _explain(terms, past, active, lower, upper, spread, guess, theta):  # noqa: PLR0917
    best, latest = guess, len(past.theta) - 1
    after, evidence, misfit = _at(terms, past, active, lower, upper, spread, best, theta)
    for direction in (-1, 1):
        for _ in range(TRIALS):
            onset = best + direction
            if onset < 0 or onset > latest:
                break
            found, odds, left = _at(terms, past, active, lower, upper, spread, onset, after)
            if odds <= evidence:
                break
            best, after, evidence, misfit = onset, found, odds, left
    measured = 0
    for k in range(best, len(past.present)):
        measured += past.present[k]
    return best, after, evidence, misfit / max(measured, 1)


@compiled
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
        past.epsilon[onset + 1 : onset + 1 + len(past.colour)],
        past.colour,
        past.variance,
        active,
        lower,
        upper,
        spread,
    )
    return theta, past.likelihood[onset] + evidence, misfit


@compiled
def _refit(  # noqa: PLR0917
    terms, before, start, x, u, y, present, epsilon, colour, variance, active, lower, upper, spread
):
    p, q = len(before), len(active)
    theta, deviation = np.empty(p), np.empty(q)
    for i in range(p):
        theta[i] = before[i]
    for a in range(q):
        theta[active[a]] = start[active[a]]
        deviation[a] = spread * abs(before[active[a]])
    trial, step, damping = theta, np.zeros(q), 1e-3
    for tries in range(1 + (ITERATIONS if q else 0)):
        fit, H_trial, g_trial = normal_equations(
            terms, trial, x, u, y, present, epsilon, colour, variance, active
        )
        tried = fit + _prior(trial, before, active, deviation, H_trial, g_trial)
        if not tries:
            misfit, cost, H, g = fit, tried, H_trial, g_trial
        elif tried < cost:
            gained = cost - tried
            theta, misfit, cost, H, g = trial, fit, tried, H_trial, g_trial
            damping = max(damping / 10, NARROWEST)
            if gained < CONVERGED:
                break
        else:
            damping *= 10
            if damping > WIDEST or _product(step, g) < CONVERGED:
                break
        _solve(H, g, damping, step)
        trial = _moved(theta, step, active, lower, upper)
    logarithm = 0.0
    if q:
        logarithm = _solve(H, g, 0.0, step)
        for a in range(q):
            logarithm += 2 * np.log(deviation[a])
    return theta, -(cost + logarithm) / 2, misfit


@compiled
def _product(a, b):
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@compiled
def _moved(theta, step, active, lower, upper):
    """Return θ with a step of some parameters, inside the box."""
    trial = np.empty(len(theta))
    for i in range(len(theta)):
        trial[i] = theta[i]
    for a in range(len(step)):
        i = active[a]
        trial[i] = min(max(theta[i] + step[a], lower[i]), upper[i])
    return trial


@compiled
def _solve(H, g, damping, x):
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
def _prior(theta, before, active, deviation, H, g):  # noqa: PLR0917
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
def normal_equations(terms, theta, x, u, y, present, epsilon, colour, variance, active):  # noqa: PLR0917
    """
    Return Σε²/σ², Σψψᵀ/σ² and Σψε/σ² over a stretch, of whitened ε and ψ.

    Parameters
    ----------
    terms, theta, active
        As for `explain`.
    x : (n,) array
        State before the stretch, which does not depend on θ.
    u, y, present : (N, 2), (N,), (N,) arrays
    epsilon, colour, variance
        As in `Past`, the residuals right before the stretch.
    """
    prepared = prepare(terms, theta, active)
    n, q, order = terms.n, len(active), len(colour)
    X = np.zeros((1 + q, n + 1))
    for i in range(n):
        X[0, i] = x[i]
    moved = np.empty_like(X)
    lags = np.zeros((1 + q, order))  # of ε and ψ, latest first
    for i in range(order):
        lags[0, i] = epsilon[order - 1 - i]
    white = np.empty(1 + q)
    H, g, misfit = np.zeros((q, q)), np.zeros(q), 0.0
    for k in range(len(u)):
        follow(prepared, X, moved, u[k])
        X, moved = moved, X
        for a in range(1 + q):
            expected = 0.0
            for i in range(order):
                expected += colour[i] * lags[a, i]
            fresh = X[a, n] if a else y[k] - X[0, n]
            if not present[k]:  # as if it had come as expected
                fresh = expected
            white[a] = fresh - expected
            for i in range(order - 1, 0, -1):
                lags[a, i] = lags[a, i - 1]
            lags[a, 0] = fresh
        misfit += white[0] ** 2
        for a in range(q):
            g[a] += white[1 + a] * white[0]
            for b in range(a + 1):
                H[a, b] += white[1 + a] * white[1 + b]
    for a in range(q):
        g[a] /= variance
        for b in range(a + 1):
            H[a, b] /= variance
            H[b, a] = H[a, b]
    return misfit / variance, H, g
