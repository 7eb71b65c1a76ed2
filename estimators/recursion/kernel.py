"""The loop of the recursive prediction-error method, compiled once for each pattern of a model."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.sampling.compiler import compile_loop, jit
from flexaxis.estimators.sampling.lanes import advance, evaluate
from flexaxis.estimators.sampling.pattern import Pattern
from flexaxis.estimators.sampling.plan import MAX_ORDER, plan

Array = NDArray[np.float64]


KNOWN = 50.0  # samples from which on the noise variance can judge a residual


def tuning_type(pattern: Pattern) -> np.dtype:
    """Return the record type of what stays as it is while a filter runs."""
    p = pattern.p
    return np.dtype(
        [
            ("coefficients", float, (len(pattern.terms),)),
            ("weights", float, (MAX_ORDER,)),  # 1/1!, 1/2!, …
            ("order", int),
            ("substeps", int),
            ("forgetting", float),
            ("drift", float, (p, p)),
            ("regularization", float),
            ("lower", float, (p,)),
            ("upper", float, (p,)),
            ("memory", float),  # of the noise variance [samples]
            ("correct", float),  # 1 where the state moves with θ, else 0
            ("clip", float),  # of residuals [standard deviations]; 0 for never
        ],
        align=True,
    )


def state_type(pattern: Pattern) -> np.dtype:
    """Return the record type of the state of a filter."""
    p, lanes = pattern.p, pattern.lanes
    return np.dtype(
        [
            ("theta", float, (p,)),
            ("P", float, (p, p)),
            ("M", float, (len(pattern.entries), lanes)),  # entries of [A B; C 0] and derivatives
            ("X", float, (pattern.n + 1, lanes)),  # x and output, with their derivatives
            ("psi", float, (p,)),
            ("gain", float, (p,)),
            ("moved", float, (p,)),  # θ in the last measurement update
            ("epsilon", float),
            ("noise", float),
            ("samples", float),  # that the noise variance is the mean of
        ],
        align=True,
    )


def grown(kind: np.dtype, fields: list) -> np.dtype:
    """
    Return a record type with more fields, which come first.

    Behind the others they would make numba take the record for one of the smaller type, which it
    calls experimental, as soon as both are compiled in one process.
    """
    assert kind.fields is not None and kind.names is not None  # it is a record
    return np.dtype(fields + [(name, kind.fields[name][0]) for name in kind.names], align=True)


@lru_cache
def rpem_loop(pattern: Pattern) -> Callable:
    """
    Return the compiled loop for models of this pattern.

    Returns
    -------
    callable
        ``run(tuning, state, u, y, valid, estimates)`` filters N samples, from ``state`` and back
        into it, and writes θ to ``estimates`` (N, p).
    """
    flat = pattern.flat()

    def run(tunings, states, u, y, valid, estimates):  # noqa: PLR0917
        tuning, state = tunings[0], states[0]
        for k in range(len(u)):
            measure(tuning, state, y[k], valid[k])
            if tuning["correct"] > 0.0:
                correct_state(state)
            predict(tuning, state)
            evaluate(flat, tuning["coefficients"], state["theta"], state["M"])
            advance(
                flat,
                state["M"],
                state["X"],
                u[k],
                tuning["weights"],
                tuning["order"],
                tuning["substeps"],
            )
            for i in range(len(state["theta"])):
                estimates[k, i] = state["theta"][i]

    return compile_loop(run, flat, tuning_type(pattern), state_type(pattern))


@jit
def measure(tuning, state, y, valid):
    """Measurement update of θ and P, eq. (5)–(7), and projection of θ on the box."""
    theta, P, psi, gain = state["theta"], state["P"], state["psi"], state["gain"]
    p = len(theta)
    for i in range(p):
        psi[i] = state["X"][-1, 1 + i]
        state["moved"][i] = 0.0
    state["epsilon"] = np.nan
    if valid:
        state["epsilon"] = y - state["X"][-1, 0]
        s = 1.0
        for i in range(p):
            gain[i] = 0.0
            for j in range(p):
                gain[i] += P[i, j] * psi[j]
            s += psi[i] * gain[i]
        weight = 1.0 / s
        surprise = state["epsilon"]
        if tuning["clip"] > 0.0 and state["samples"] >= KNOWN:
            limit = tuning["clip"] * np.sqrt(state["noise"] * s)
            if surprise > limit:
                surprise = limit
            elif surprise < -limit:
                surprise = -limit
        for i in range(p):
            state["moved"][i] = gain[i] * (surprise * weight)
            theta[i] += state["moved"][i]
        subtract(P, gain, weight)
        state["samples"] = min(state["samples"] + 1.0, tuning["memory"])
        state["noise"] += (surprise**2 * weight - state["noise"]) / state["samples"]
    for i in range(p):
        if theta[i] < tuning["lower"][i]:  # not min and max, which would hide a NaN
            theta[i] = tuning["lower"][i]
        elif theta[i] > tuning["upper"][i]:
            theta[i] = tuning["upper"][i]


@jit
def correct_state(state):
    """Move state and output to where the new θ would have taken them, x ← x + z Δθ."""
    X, moved = state["X"], state["moved"]
    for i in range(len(X)):
        for j in range(len(moved)):
            X[i, 0] += X[i, 1 + j] * moved[j]


@jit
def predict(tuning, state):
    """Time update of P, eq. (9) or (10), and regularisation, eq. (12)."""
    P, column = state["P"], state["gain"]  # the gain has done its work and lends its place
    p = len(P)
    growth = 1.0 / tuning["forgetting"]
    for i in range(p):
        for j in range(p):
            P[i, j] = growth * P[i, j] + tuning["drift"][i, j]
    mu = tuning["regularization"]
    if mu > 0.0:
        for axis in range(p):  # (12) measures every parameter once, with weight μ
            for i in range(p):
                column[i] = P[i, axis]
            subtract(P, column, mu / (1.0 + mu * P[axis, axis]))


@jit
def subtract(P, v, w):
    """P ← P − w v vᵀ on one triangle, mirrored, so that P stays symmetric for ever."""
    for i in range(len(P)):
        for j in range(i + 1):
            P[i, j] -= w * v[i] * v[j]
            P[j, i] = P[i, j]


def filter_records(
    design: Design, pattern: Pattern, coefficients: Array
) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Return tuning and start of a filter, as records for the compiled loop."""
    order, substeps = plan(design.model, design.lower, design.upper, design.period)
    row, column, _ = np.array(pattern.entries).T
    scale = np.where(row < pattern.n, design.period / substeps, 1.0)  # the output is read, not run

    tuning = np.zeros(1, tuning_type(pattern))
    tuning["coefficients"] = coefficients * scale[[entry for entry, *_ in pattern.terms]]
    tuning["weights"] = 1 / np.cumprod(np.arange(1.0, MAX_ORDER + 1))
    tuning["order"], tuning["substeps"] = order, substeps
    tuning["forgetting"], tuning["drift"] = design.forgetting, design.drift
    tuning["regularization"] = 0.0
    tuning["lower"], tuning["upper"] = design.lower, design.upper
    tuning["memory"] = 400.0

    state = np.zeros(1, state_type(pattern))
    state["theta"], state["P"] = design.theta0, design.P0
    blocks = design.model.blocks(design.theta0)
    state["M"][0, :, : len(blocks)] = (blocks[:, row, column] * scale).T
    state["epsilon"], state["noise"] = np.nan, 1.0
    return tuning, state
