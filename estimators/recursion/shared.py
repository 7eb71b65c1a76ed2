"""
Interacting multiple models that share one linearisation, in compiled code.

The modes of `flexaxis.estimators.recursion.modes` each run a filter of their own. Where they differ
in what they allow θ to do in a sample, but not in the model, all of them may be linearised at the
mean of the mixture: with F = [I 0; G] and h there, mode j has the mean ξ̄ + δ_j and

    ŷ_j = ŷ(ξ̄) + hᵀδ_j,  δ_j⁺ = F δ_j + K_j (y − ŷ_j),  P_j⁺ = F P_j Fᵀ + W_j − K_j S_j K_jᵀ,

so that a sample takes one step of the model, whatever the number of modes. θ comes first in ξ; the
first mode is the quiet one, and in each of the others one of θ jumps.
"""

import numpy as np

from flexaxis.estimators.recursion.modes import LEAST
from flexaxis.estimators.sampling.compiler import inlined
from flexaxis.estimators.sampling.symmetric import carry, look, merge

LOUDEST = 0.95  # correlation of innovations that follow each other, at most


@inlined
def foresee(state):
    """Write hᵀP_j h and hᵀδ_j; return mean and variance of ŷ over the mixture."""
    X, delta = state["X"], state["delta"]
    spread, shift, weight = state["spread"], state["shift"], state["predicted"]
    modes, m = len(delta), len(state["gain"])
    mean, variance = 0.0, 0.0
    for j in range(modes):
        spread[j] = look(X, state["P"][j], state["Ph"])
        shift[j] = 0.0
        for b in range(m):
            shift[j] += X[-1, 1 + b] * delta[j, b]
        mean += weight[j] * shift[j]
    for j in range(modes):
        variance += weight[j] * (spread[j] + (shift[j] - mean) ** 2)
    return X[-1, 0] + mean, variance


@inlined
def transit(tuning, state, y, noise):
    """Take δ_j and P_j of every mode over the last sample, and through y unless that is NaN."""
    X, P, gain, which = state["X"], state["P"], state["gain"], tuning["which"]
    measured = not np.isnan(y)
    for j in range(len(state["P"])):
        look(X, P[j], state["Ph"])
        root = 1.0 / np.sqrt(state["spread"][j] + noise) if measured else 0.0
        carry(X, state["Ph"], root, tuning["walk"], P[j], gain)
        if j > 0:
            P[j, which[j - 1], which[j - 1]] += tuning["jump"][j - 1]
        move(state, j)
        if measured:
            innovation = (y - X[-1, 0] - state["shift"][j]) * root
            state["logarithm"][j] = np.log(root) - 0.5 * innovation**2
            for a in range(len(gain)):
                state["delta"][j, a] += gain[a] * innovation


@inlined
def move(state, j):
    """δ_j ← F δ_j."""
    X, delta, moved = state["X"], state["delta"], state["moved"]
    p = len(state["gain"]) - len(moved)
    for i in range(len(moved)):
        moved[i] = 0.0
    for b in range(len(state["gain"])):
        for i in range(len(moved)):
            moved[i] += X[i, 1 + b] * delta[j, b]
    for i in range(len(moved)):
        delta[j, p + i] = moved[i]


@inlined
def repetition(tuning, state, used, S):
    """Return (1+ρ)/(1−ρ), as which many innovations in a row count as one; ρ is learnt."""
    echo = state["echo"]
    if not np.isnan(used):
        e = min(max((used - state["prediction"]) / np.sqrt(S), -3.0), 3.0)
        if not np.isnan(echo[2]):
            share = tuning["echo_share"]
            echo[0] += share * (e * echo[2] - echo[0])
            echo[1] += share * (e * e - echo[1])
        echo[2] = e
    else:
        echo[2] = np.nan
    rho = min(max(echo[0] / echo[1], 0.0), LOUDEST)
    return (1.0 + rho) / (1.0 - rho)


@inlined
def weigh_all(state, repeated):
    """μ_j ← c_j Λ_j^(1/repeated) over their sum."""
    logarithm, weight = state["logarithm"], state["probability"]
    highest = logarithm.max()
    total = 0.0
    for j in range(len(weight)):
        share = state["predicted"][j] * np.exp((logarithm[j] - highest) / repeated)
        weight[j] = max(share, LEAST)
        total += weight[j]
    for j in range(len(weight)):
        weight[j] /= total


@inlined
def mix_all(tuning, state):
    """
    Give every mode the δ⁰ and P⁰ from which it goes on: c_j = Σ_i Π_ij μ_i, μ_i|j = Π_ij μ_i/c_j.

    Two at a time, which is the same. From a jump a mode goes to quiet only, and to a jump from
    quiet only; what quiet becomes is kept beside it until the others no more need what it was.
    """
    P, delta, weight = state["P"], state["delta"], state["probability"]
    mixed, mixed_P, predicted = state["mixed"], state["mixed_P"], state["predicted"]
    stay, total = tuning["stay"], tuning["quiet"] * weight[0]
    put(delta[0], P[0], mixed, mixed_P)
    for j in range(1, len(weight)):
        share = (1.0 - stay) * weight[j]
        total += share
        join(state, mixed, mixed_P, j, share / total)
    for j in range(1, len(weight)):
        share = tuning["come"][j - 1] * weight[0]
        predicted[j] = share + stay * weight[j]
        join(state, delta[j], P[j], 0, share / predicted[j])
    predicted[0] = total
    put(mixed, mixed_P, delta[0], P[0])


@inlined
def join(state, mean, P, j, share):
    """Take mean and covariance to those of a mixture with mode j, of weight ``share``."""
    apart = state["apart"]
    for a in range(len(apart)):
        apart[a] = mean[a] - state["delta"][j, a]
        mean[a] -= share * apart[a]
    merge(share, P, state["P"][j], apart)


@inlined
def put(mean, P, other, other_P):
    """Write mean and covariance in another place."""
    for a in range(P.shape[0]):
        other[a] = mean[a]
        for b in range(P.shape[1]):
            other_P[a, b] = P[a, b]


@inlined
def recentre(tuning, state):
    """Put θ of every mode into the box, and ξ̄ to the mean of the modes."""
    theta, X, delta = state["theta"], state["X"], state["delta"]
    lower, upper, weight = tuning["lower"], tuning["upper"], state["predicted"]
    modes, m = len(delta), len(state["gain"])
    p = len(lower)
    for a in range(m):
        mean = 0.0
        for j in range(modes):
            if a < p:  # not min and max, which would hide a NaN
                if theta[a] + delta[j, a] < lower[a]:
                    delta[j, a] = lower[a] - theta[a]
                elif theta[a] + delta[j, a] > upper[a]:
                    delta[j, a] = upper[a] - theta[a]
            mean += weight[j] * delta[j, a]
        for j in range(modes):
            delta[j, a] -= mean
        if a < p:
            theta[a] += mean
        else:
            X[a - p, 0] += mean


@inlined
def watch(tuning, state):
    """
    Keep what is thought of the parameters that jump; write and return whether somebody has to look.

    That is where a jump has become more likely than none, and at the sample ``due``: never because
    the samples at hand have come to their end.
    """
    ring, which, weight = state["ring"], tuning["which"], state["predicted"]
    size, q = len(ring), len(which)
    row = state["samples_taken"] % size
    for a in range(q):
        i = which[a]
        ring[row, a] = state["theta"][i]
        for b in range(q):
            total = 0.0
            for j in range(q + 1):
                apart = state["delta"][j, i] * state["delta"][j, which[b]]
                total += weight[j] * (state["P"][j, i, which[b]] + apart)
            ring[row, q + a * q + b] = total
    jumping = 1.0 - state["probability"][0]
    ring[row, q + q * q] = jumping
    taken = state["samples_taken"]
    state["samples_taken"] = taken + 1
    state["calm"] = state["calm"] + 1 if jumping < tuning["calm_below"] else 0
    if state["armed"] == 0 and state["calm"] >= tuning["calm_for"]:
        state["armed"] = 1
    begun = state["armed"] == 1 and jumping > tuning["alarm_above"]
    state["asks"] = 1 if begun or taken == state["due"] else 0
    return state["asks"] == 1
