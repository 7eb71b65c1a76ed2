"""The modes of `methods.imm`: how likely each is, and how they are mixed, in compiled code."""

import numpy as np

from flexaxis.estimators.filters.covariance import merge
from flexaxis.estimators.models.compiler import inlined

LEAST = 1e-30  # probability of a mode: from zero none comes back


@inlined
def listen(state, y, noise):
    """Keep log Λ of the innovation, before it is used."""
    state["logarithm"] = 0.0
    if not np.isnan(y):
        S = state["spread"] + noise
        state["logarithm"] = -0.5 * (np.log(S) + (y - state["X"][-1, 0]) ** 2 / S)


@inlined
def weigh(states):
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
def mix(tunings, states, n, p):
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
