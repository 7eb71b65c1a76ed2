"""Interacting multiple models: how likely each mode is, how they are mixed, and their loop."""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.covariance import merge
from flexaxis.estimators.filters.joint import correct, look, start_sample
from flexaxis.estimators.filters.loop import Record, sample_loop
from flexaxis.estimators.filters.noise import judge, show
from flexaxis.estimators.models.compiler import Compiled, inlined, remembered
from flexaxis.estimators.models.discretisation import Pattern

Array = NDArray[np.float64]

LEAST = 1e-30  # probability of a mode: from zero none comes back


@inlined
def _listen(state, y, noise):
    """Keep log Λ of the innovation, before it is used."""
    state["logarithm"] = 0.0
    if not np.isnan(y):
        S = state["spread"] + noise
        state["logarithm"] = -0.5 * (np.log(S) + (y - state["X"][-1, 0]) ** 2 / S)


@inlined
def _weigh(states):
    """μ_j ← c_j Λ_j over their sum."""
    highest = -np.inf
    for j in range(len(states)):
        highest = max(highest, states[j]["logarithm"])
    total = 0.0
    for j in range(len(states)):
        share = states[j]["predicted"] * np.exp(states[j]["logarithm"] - highest)
        states[j]["probability"] = share if share > LEAST else LEAST
        total += states[j]["probability"]
    for j in range(len(states)):
        states[j]["probability"] /= total


@inlined
def _transition(tunings, i, j):
    """Return Π_ij: from quiet to any jump, from a jump to quiet only."""
    stay = tunings[i]["stay"]
    if i == j:
        return stay
    if i == 0:
        return (1.0 - stay) / (len(tunings) - 1)
    return 1.0 - stay if j == 0 else 0.0


@inlined
def _mix(tunings, states, n, p):
    """
    Give every mode the ξ⁰ and P⁰ from which it goes on.

    Two at a time, which is the same. A jump mode goes on from itself or quiet, the quiet one from
    all; the sum for it is kept beside it until the others no more need what it was.
    """
    quiet = states[0]
    for j in range(len(states)):
        _gather(states[j], n, p)
    for a in range(p + n):
        quiet["mixed"][a] = quiet["xi"][a]
        for b in range(quiet["P"].shape[1]):
            quiet["mixed_P"][a, b] = quiet["P"][a, b]
    total = _transition(tunings, 0, 0) * quiet["probability"]
    for j in range(1, len(states)):
        weight = _transition(tunings, j, 0) * states[j]["probability"]
        total += weight
        _join(quiet["mixed"], quiet["mixed_P"], states[j], weight / total, quiet["apart"])
    for j in range(1, len(states)):
        state, weight = states[j], _transition(tunings, 0, j) * quiet["probability"]
        state["predicted"] = weight + _transition(tunings, j, j) * state["probability"]
        _join(state["xi"], state["P"], quiet, weight / state["predicted"], quiet["apart"])
    quiet["predicted"] = total
    for a in range(p + n):
        quiet["xi"][a] = quiet["mixed"][a]
        for b in range(quiet["P"].shape[1]):
            quiet["P"][a, b] = quiet["mixed_P"][a, b]
    for j in range(len(states)):
        _spread_out(states[j], n, p)


@inlined
def _join(mean, P, other, share, apart):
    """Take mean and covariance to those of a mixture with another mode, of weight ``share``."""
    for a in range(len(mean)):
        apart[a] = mean[a] - other["xi"][a]
        mean[a] -= share * apart[a]
    merge(share, P, other["P"], apart)


@inlined
def _gather(state, n, p):
    """Write ξ = [θ; x]."""
    for a in range(p):
        state["xi"][a] = state["theta"][a]
    for i in range(n):
        state["xi"][p + i] = state["X"][i, 0]


@inlined
def _spread_out(state, n, p):
    """Write θ and x from ξ."""
    for a in range(p):
        state["theta"][a] = state["xi"][a]
    for i in range(n):
        state["X"][i, 0] = state["xi"][p + i]


def read_mixture(p: int, state: Record) -> tuple[Array, Array]:
    """Return η (p,) of the mixture of the modes, and its covariance (p, p)."""
    weights, theta = state["predicted"], state["theta"][:, :p]  # both after mixing
    mean = weights @ theta
    apart = theta - mean
    covariance = np.einsum("j,jab->ab", weights, state["P"][:, :p, :p])
    return mean, covariance + np.einsum("j,ja,jb->ab", weights, apart, apart)


@remembered
def imm_loop(pattern: Pattern) -> Compiled:
    """
    Return the compiled loop for models of this pattern.

    Tuning and state have a record for each mode; the first is the quiet one.
    """
    return sample_loop(pattern, _take, "interacting multiple models")


@inlined
def _take(tunings, states, k, u, y, valid, estimates, trace):  # noqa: PLR0917
    """Do with a sample what `flexaxis.estimators.filters.loop.sample_loop` asks for."""
    p = estimates.shape[1]
    n = len(states[0]["gain"]) - p
    used = _look_together(tunings[0], states, y[k], valid[k])
    noise = states[0]["noise"]
    for j in range(len(states)):
        _listen(states[j], used, noise)
        correct(tunings[j], states[j], used, noise)
    _weigh(states)
    for i in range(p):
        estimates[k, i] = 0.0
        for j in range(len(states)):
            estimates[k, i] += states[j]["probability"] * states[j]["theta"][i]
    _mix(tunings, states, n, p)
    for j in range(len(states)):
        start_sample(states[j]["X"], n, p)
    show(states[0], trace[k])
    return states[0]["anew"] > 0.0


@inlined
def _look_together(tuning, states, y, valid):
    """Judge the sample by the mixture's prediction and its variance, in the first record."""
    mean, spread = 0.0, 0.0
    for j in range(len(states)):
        look(states[j])
        mean += states[j]["predicted"] * states[j]["X"][-1, 0]
    for j in range(len(states)):
        apart = states[j]["X"][-1, 0] - mean
        spread += states[j]["predicted"] * (states[j]["spread"] + apart**2)
    return judge(tuning, states[0], y, valid, mean, spread)
