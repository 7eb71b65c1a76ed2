"""State and parameters in one extended Kalman filter, on lanes: what its kinds share."""

import numpy as np

from flexaxis.estimators.filters.covariance import bound, carry, padded, project
from flexaxis.estimators.filters.covariance import look as look_at
from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.filters.loop import Record, joined, on_lanes, record
from flexaxis.estimators.filters.noise import level
from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.models.discretisation import Pattern


def ekf_records(design: Design, pattern: Pattern, *, rests: bool = False) -> tuple[Record, Record]:
    """
    Return tuning and start of the filter.

    Parameters
    ----------
    design : Design
    pattern : Pattern
    rests : bool
        As for `flexaxis.estimators.filters.noise.level`.
    """
    p, n, m = len(design.theta0), pattern.states, pattern.p
    tuning, start = on_lanes(design, pattern)
    blocks, P = design.model.blocks(design.theta0), np.zeros((m, padded(m)))
    P[:p, :p] = design.P0
    P[p:, p:m] = design.x0_covariance
    X, C = start["X"][0], blocks[:, -1, :-1]
    X[:n, 1 + p : 1 + m] = np.eye(n)
    X[-1, 1 : 1 + p], X[-1, 1 + p : 1 + m] = C[1:] @ design.x0, C[0, :n]
    limits = record(
        drift=design.drift,
        ceiling=np.ones(p),  # of the variance of θ
        lower=design.lower,
        upper=design.upper,
    )
    work = record(
        P=P,  # of ξ = [θ; x]
        Ph=np.zeros(m),
        gain=np.zeros(m),  # K √S
        spread=0.0,  # hᵀPh
    )
    known, level_start = level(design, rests=rests)
    return joined(tuning, limits, known), joined(start, work, level_start)


def with_state(pattern: Pattern) -> Pattern:
    """
    Return the pattern with a parameter more for each state, on which no entry depends.

    Their lanes, set to one at x(0), become the derivatives by the state at the start of the
    sample: the transition matrix comes out of the same rows as ∂x/∂θ.
    """
    n = pattern.states
    return pattern._replace(
        p=pattern.p + n, terms=tuple((*term, *[0] * n) for term in pattern.terms)
    )


@inlined
def start_sample(X, n, p):
    """Set the derivatives by ξ at the start of a sample: ∂x/∂θ = 0, ∂x/∂x = I."""
    for i in range(n):
        for j in range(1, 1 + p + n):
            X[i, j] = 1.0 if j == 1 + p + i else 0.0


@inlined
def look(state):
    """Write P h and hᵀPh, with h = ∂y⁺/∂ξ by ξ of the sample before."""
    state["spread"] = look_at(state["X"], state["P"], state["Ph"])


@inlined
def correct(tuning, state, y, noise):
    """
    Take P over the last sample, and ξ and P through the measurement unless that is NaN.

    With F = [I 0; G], G = ∂x⁺/∂ξ, and h = ∂y⁺/∂ξ, both by ξ of the sample before:
    S = hᵀPh + R, K = F P h/S, ξ ← ξ⁺ + K (y − y⁺), P ← F P Fᵀ + W − K S Kᵀ.
    """
    P, X, gain, theta = state["P"], state["X"], state["gain"], state["theta"]
    p = len(tuning["lower"])
    measured = not np.isnan(y)
    root = 1.0 / np.sqrt(state["spread"] + noise) if measured else 0.0
    carry(X, state["Ph"], root, tuning["drift"], P, gain)
    if measured:
        innovation = (y - X[-1, 0]) * root
        for i in range(p):
            theta[i] += gain[i] * innovation
        for i in range(len(gain) - p):
            X[i, 0] += gain[p + i] * innovation
    bound(P, tuning["ceiling"])
    project(theta, tuning["lower"], tuning["upper"])
