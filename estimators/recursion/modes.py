"""The modes of `methods.imm`: how likely each is, and how they are mixed, in compiled code."""

import numpy as np

from flexaxis.estimators.sampling.compiler import inlined

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
def transition(tunings, i, j):
    """Return Π_ij: from quiet to any jump, from a jump to quiet only."""
    stay = tunings[i]["stay"]
    if i == j:
        return stay
    if i == 0:
        return (1.0 - stay) / (len(tunings) - 1)
    return 1.0 - stay if j == 0 else 0.0


@inlined
def mix(tunings, states, n, p):
    """Give every mode the ξ⁰ and P⁰ from which it goes on."""
    for j in range(len(states)):
        c = 0.0
        for i in range(len(states)):
            c += transition(tunings, i, j) * states[i]["probability"]
        states[j]["predicted"] = c
        blend(tunings, states, j, c, p + n, p)
    for j in range(len(states)):
        state = states[j]
        for a in range(p + n):
            if a < p:
                state["theta"][a] = state["mixed"][a]
            else:
                state["X"][a - p, 0] = state["mixed"][a]
            for b in range(a + 1):
                state["P"][a, b] = state["P"][b, a] = state["mixed_P"][a, b]


@inlined
def blend(tunings, states, j, c, m, p):  # noqa: PLR0917
    """Write ξ⁰_j and the lower triangle of P⁰_j, beside what they are made from."""
    mixed, mixed_P = states[j]["mixed"], states[j]["mixed_P"]
    for a in range(m):
        mixed[a] = 0.0
        for i in range(len(states)):
            weight = transition(tunings, i, j) * states[i]["probability"] / c
            mixed[a] += weight * component(states[i], a, p)
    for a in range(m):
        for b in range(a + 1):
            mixed_P[a, b] = 0.0
            for i in range(len(states)):
                weight = transition(tunings, i, j) * states[i]["probability"] / c
                apart = component(states[i], a, p) - mixed[a]
                other = component(states[i], b, p) - mixed[b]
                mixed_P[a, b] += weight * (states[i]["P"][a, b] + apart * other)


@inlined
def component(state, a, p):
    """Return ξ_a of [θ; x]."""
    return state["theta"][a] if a < p else state["X"][a - p, 0]
