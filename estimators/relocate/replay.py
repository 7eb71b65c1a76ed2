"""Least squares around known parameters over a stretch: a filter as if it had known all along."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.follow import follow
from flexaxis.estimators.relocate.work import CALL, Work, finished, of_sample, samples_of, to_begin
from flexaxis.estimators.sampling.compiler import compiled
from flexaxis.estimators.sampling.prepared import Prepared, copy, prepare
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]


class Now(NamedTuple):
    """
    The filter between two samples, which compiled code writes.

    Attributes
    ----------
    prepared : Prepared
    X, moved : (1+p, n+1) arrays
        State and output, and their sensitivities; room for the next.
    P, claim : (p, p) arrays
    delta : (p,) array
        What the data have added to θ.
    """

    prepared: Prepared
    X: Array
    moved: Array
    P: Array
    claim: Array
    delta: Array


class Replayed(NamedTuple):
    """
    A filter after each of N samples, and, in the last place, before the measurement of the next.

    Attributes
    ----------
    theta : (N+1, p) array
    P : (N+1, p, p) array
        For a noise variance of one.
    claim : (N+1, p, p) array
        Σ, the covariance that θ̂ really has for a noise variance of one.
    X : (N+1, 1+p, n+1) array
        State and output, and their sensitivities.
    epsilon : (N+1,) array
        Residual of each measurement; NaN in gaps.
    scale, spread : (N+1,) arrays
        1 + ψᵀPψ and 1 + ψᵀΣψ before it; one in gaps.
    """

    theta: Array
    P: Array
    claim: Array
    X: Array
    epsilon: Array
    scale: Array
    spread: Array

    def of_all(self) -> dict[str, Array]:
        """Return what a filter remembers of the parameters, by the names of its fields."""
        X = self.X.transpose(0, 2, 1)
        return {"theta": self.theta, "P": self.P, "claim": self.claim, "X": X, "psi": X[:, -1, 1:]}


def replay(  # noqa: PLR0917
    terms: Terms,
    theta: Array,
    X: Array,
    P: Array,
    claim: Array,
    signals: tuple[Array, Array, NDArray[np.bool_]],
    *,
    forgetting: float | Array,
    box: tuple[Array, Array],
    drift: Array | None = None,
    before: Array | None = None,
) -> Replayed:
    """
    Run the main filter with its model fixed at θ, its state corrected for what it adds to θ.

    Eq. (5)–(9) with ε = y − ŷ(θ) − ψᵀδ, where δ is what the data add to θ; zero where P is.

    Parameters
    ----------
    terms : Terms
        The model with all parameters.
    theta : (p,) array
        What the model is linearised at.
    X : (1+p, n+1) array
        State, and its sensitivities, at the start.
    P, claim : (p, p) arrays
        At the start.
    signals : u (N+1, 2), y (N,), present (N,)
        Torque held after the start and after each sample, and the motor angle there; the output at
        each sample, and whether it was measured.
    forgetting : float or (p, p) array
        λ, by which P is divided after each measurement, or one for each of its elements.
    box : (lower, upper), each (p,)
        On which θ is projected; the data are weighed as if it were not there.
    drift : (p, p) array, optional
        Δ, which P gains besides.
    before : (p,) array, optional
        Parameters at the start, if they are not those that the model is linearised at.
    """
    return finished(
        replaying(
            terms,
            theta,
            X,
            P,
            claim,
            signals,
            forgetting=forgetting,
            box=box,
            drift=drift,
            before=before,
        )
    )


def replaying(  # noqa: PLR0917
    terms: Terms,
    theta: Array,
    X: Array,
    P: Array,
    claim: Array,
    signals: tuple[Array, Array, NDArray[np.bool_]],
    *,
    forgetting: float | Array,
    box: tuple[Array, Array],
    drift: Array | None = None,
    before: Array | None = None,
    grain: float = np.inf,
) -> Work[Replayed]:
    """Do as `replay`, in pieces of so many operations."""
    u, y, present = signals
    N, (rows, columns) = len(u), X.shape
    p = rows - 1
    cost = of_sample(terms, rows) + 6 * p * p + 4 * p * columns
    samples = samples_of(grain, cost)
    yield to_begin(terms, rows)
    made = Replayed(
        np.empty((N, p)),
        np.empty((N, p, p)),
        np.empty((N, p, p)),
        np.empty((N, rows, columns)),
        np.full(N, np.nan),
        np.ones(N),
        np.ones(N),
    )
    room = X.copy(), np.empty(X.shape), P.copy(), claim.copy()
    delta = np.zeros(p) if before is None else before - theta
    now = Now(prepare(terms, theta, np.arange(p)), *room, delta)
    fading = np.broadcast_to(forgetting, P.shape).copy()
    gained = np.zeros(P.shape) if drift is None else drift
    known = np.r_[y, 0.0], np.r_[present, False]
    for first in range(0, N, samples):
        last = min(first + samples, N)
        yield 2 * CALL + cost * (last - first)
        _replay(now, theta, u, *known, fading, gained, made, first, last)
        some = slice(first, last)
        moved = np.clip(made.theta[some], *box) - made.theta[some]
        made.theta[some] += moved
        made.X[some, 0] += np.einsum("kp,kpn->kn", moved, made.X[some, 1:])
    return made


@compiled
def _replay(now, theta, u, y, present, fading, drift, made, first, last):  # noqa: PLR0917
    prepared, ahead, moved, P, claim, delta = now
    p, n = len(theta), ahead.shape[1] - 1
    gain, spread = np.zeros(p), np.zeros(p)
    for k in range(first, last):
        follow(prepared, ahead, moved, u[k])
        ahead, moved = moved, ahead
        # u[k] follows the measurement before; where that is missing, nothing is forgotten
        for i in range(p if k == 0 or present[k - 1] else 0):
            for j in range(p):
                P[i, j] = P[i, j] / fading[i, j] + drift[i, j]
        if present[k]:
            s, total, epsilon = 1.0, 1.0, y[k] - ahead[0, n]
            for i in range(p):
                gain[i] = spread[i] = 0.0
                for j in range(p):
                    gain[i] += P[i, j] * ahead[1 + j, n]
                    spread[i] += claim[i, j] * ahead[1 + j, n]
                s += gain[i] * ahead[1 + i, n]
                total += spread[i] * ahead[1 + i, n]
                epsilon -= ahead[1 + i, n] * delta[i]
            made.epsilon[k], made.scale[k], made.spread[k] = epsilon, s, total
            for i in range(p):
                a = gain[i] / s
                delta[i] += a * epsilon
                for j in range(i + 1):
                    b = gain[j] / s
                    P[i, j] -= a * gain[j]
                    P[j, i] = P[i, j]
                    claim[i, j] += total * a * b - a * spread[j] - spread[i] * b
                    claim[j, i] = claim[i, j]
        _write(made, k, theta, delta, ahead, P, claim)
    if (last - first) % 2:  # the two rooms have changed places
        copy(ahead, now.X)


@compiled
def _write(made, k, theta, delta, X, P, claim):  # noqa: PLR0917
    """Write θ + δ, P, Σ, and the state moved along with δ, x + z δ."""
    p = len(theta)
    for i in range(p):
        made.theta[k, i] = theta[i] + delta[i]
        for j in range(p):
            made.P[k, i, j] = P[i, j]
            made.claim[k, i, j] = claim[i, j]
    for m in range(X.shape[1]):
        made.X[k, 0, m] = X[0, m]
        for i in range(p):
            made.X[k, 1 + i, m] = X[1 + i, m]
            made.X[k, 0, m] += X[1 + i, m] * delta[i]
