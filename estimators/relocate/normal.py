"""Normal equations of a stretch of data around known parameters, over some samples at a time."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.follow import follow
from flexaxis.estimators.relocate.work import CALL, Work, of_sum, samples_of, to_begin
from flexaxis.estimators.sampling.compiler import compiled
from flexaxis.estimators.sampling.prepared import Prepared, copy, prepare
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]


class Sums(NamedTuple):
    """
    What is known of a stretch after some of its samples.

    Attributes
    ----------
    prepared : Prepared
        The model at its parameters.
    X, moved : (1+q, n+1) arrays
        State and output, and their sensitivities; room for the next.
    lags : (1+q, ORDER) array
        The last ε and ψ, latest first.
    white : (1+q,) array
        Room.
    H, g, misfit : (q, q), (q,), (1,) arrays
        Σψψᵀ, its lower triangle, Σψε and Σε².
    """

    prepared: Prepared
    X: Array
    moved: Array
    lags: Array
    white: Array
    H: Array
    g: Array
    misfit: Array


@compiled
def begun(terms, theta, active, x, epsilon, order):  # noqa: PLR0917
    """
    Return the sums before the first sample.

    Parameters
    ----------
    terms, theta, active, x, epsilon
        As for `normal_equations`.
    order : int
        How many residuals before the stretch are given.
    """
    prepared = prepare(terms, theta, active)
    n, q = terms.n, len(active)
    X = np.zeros((1 + q, n + 1))
    for i in range(n):
        X[0, i] = x[i]
    lags = np.zeros((1 + q, order))
    for i in range(order):
        lags[0, i] = epsilon[order - 1 - i]
    room = np.empty_like(X), lags, np.empty(1 + q)
    return Sums(prepared, X, *room, np.zeros((q, q)), np.zeros(q), np.zeros(1))


@compiled
def add(sums, u, y, present, colour, first, last):  # noqa: PLR0917
    """Add the samples of a stretch from first to last, which follow those added before."""
    X, moved, lags, white = sums.X, sums.moved, sums.lags, sums.white
    q, n, order = len(sums.g), X.shape[1] - 1, len(colour)
    misfit = sums.misfit[0]
    for k in range(first, last):
        follow(sums.prepared, X, moved, u[k])
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
            sums.g[a] += white[1 + a] * white[0]
            for b in range(a + 1):
                sums.H[a, b] += white[1 + a] * white[1 + b]
    sums.misfit[0] = misfit
    if (last - first) % 2:  # the two rooms have changed places
        copy(X, sums.X)


@compiled
def finish(sums, variance):
    """Divide the sums by the variance and mirror H; return Σε²/σ²."""
    for a in range(len(sums.g)):
        sums.g[a] /= variance
        for b in range(a + 1):
            sums.H[a, b] /= variance
            sums.H[b, a] = sums.H[a, b]
    return sums.misfit[0] / variance


@compiled
def normal_equations(terms, theta, x, u, y, present, epsilon, colour, variance, active):  # noqa: PLR0917
    """
    Return Σε²/σ², Σψψᵀ/σ² and Σψε/σ² over a stretch, of whitened ε and ψ.

    Parameters
    ----------
    terms : Terms
        The model with all parameters.
    theta : (p,) array
        The parameters.
    x : (n,) array
        State before the stretch, which does not depend on θ.
    u, y, present : (N, 2), (N,), (N,) arrays
    epsilon, colour, variance
        As in `flexaxis.estimators.relocate.fit.Past`, the residuals right before the stretch.
    active : (q,) int array
        Parameters to differentiate by.
    """
    sums = begun(terms, theta, active, x, epsilon, len(colour))
    add(sums, u, y, present, colour, 0, len(u))
    misfit = finish(sums, variance)
    return misfit, sums.H, sums.g


def summing(  # noqa: PLR0917
    terms: Terms,
    theta: Array,
    x: Array,
    u: Array,
    y: Array,
    present: NDArray[np.bool_],
    epsilon: Array,
    colour: Array,
    variance: float,
    active: NDArray[np.int64],
    *,
    grain: float,
) -> Work[tuple[float, Array, Array]]:
    """Do as `normal_equations`, in pieces of so many operations."""
    cost = of_sum(terms, 1 + len(active))
    samples = samples_of(grain, cost)
    if grain == np.inf:
        yield np.inf
        given = x, u, y, present, epsilon, colour, variance, active
        return normal_equations(terms, theta, *given)  # type: ignore[no-any-return]
    yield to_begin(terms, 1 + len(active))
    sums = begun(terms, theta, active, x, epsilon, len(colour))
    for first in range(0, len(u), samples):
        yield CALL + cost * min(samples, len(u) - first)
        add(sums, u, y, present, colour, first, min(first + samples, len(u)))
    return finish(sums, variance), sums.H, sums.g
