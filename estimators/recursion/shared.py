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

LOUDEST = 0.95  # correlation of innovations that follow each other, at most


@inlined
def foresee(state):
    """Write P_j h, hᵀP_j h and hᵀδ_j; return mean and variance of ŷ over the mixture."""
    P, X, Ph, delta = state["P"], state["X"], state["Ph"], state["delta"]
    spread, shift, weight = state["spread"], state["shift"], state["predicted"]
    modes, m = len(delta), len(state["gain"])
    mean, variance = 0.0, 0.0
    for j in range(modes):
        shift[j], spread[j] = 0.0, 0.0
        for a in range(m):
            Ph[j, a] = 0.0
        for b in range(m):
            h = X[-1, 1 + b]
            shift[j] += h * delta[j, b]
            for a in range(m):
                Ph[j, a] += h * P[j, b, a]
        for a in range(m):
            spread[j] += X[-1, 1 + a] * Ph[j, a]
        mean += weight[j] * shift[j]
    for j in range(modes):
        variance += weight[j] * (spread[j] + (shift[j] - mean) ** 2)
    return X[-1, 0] + mean, variance


@inlined
def transit(tuning, state):
    """Take δ_j and P_j of every mode over the last sample; a measurement comes later."""
    P, X, GT = state["P"], state["X"], state["GT"]
    walk, jump, which = tuning["walk"], tuning["jump"], tuning["which"]
    for b in range(len(GT)):
        for i in range(len(state["moved"])):
            GT[b, i] = X[i, 1 + b]
    for j in range(len(P)):
        times_G(state, j)
        transport_all(state, j)
        for i in range(len(GT)):
            P[j, i, i] += walk[i]
        if j > 0:
            P[j, which[j - 1], which[j - 1]] += jump[j - 1]


@inlined
def times_G(state, j):
    """Write G P_j, and G δ_j."""
    P, GP, GT = state["P"], state["GP"], state["GT"]
    delta, moved = state["delta"], state["moved"]
    GP[:] = 0.0
    moved[:] = 0.0
    for b in range(len(GT)):
        for i in range(len(moved)):
            moved[i] += GT[b, i] * delta[j, b]
            if GT[b, i] != 0.0:
                for a in range(len(GT)):
                    GP[i, a] += GT[b, i] * P[j, b, a]


@inlined
def transport_all(state, j):
    """P_j ← F P_j Fᵀ and δ_j ← F δ_j with F = [I 0; G], given G P_j and G δ_j."""
    P, GP, GT, delta = state["P"], state["GP"], state["GT"], state["delta"]
    n, m = len(state["moved"]), len(GT)
    p = m - n
    for i in range(n):
        delta[j, p + i] = state["moved"][i]
        for a in range(n):
            P[j, p + i, p + a] = 0.0
        for b in range(m):
            for a in range(n):
                P[j, p + i, p + a] += GP[i, b] * GT[b, a]
        for a in range(p):
            P[j, p + i, a] = P[j, a, p + i] = GP[i, a]
    for i in range(n):  # exactly symmetric, or rounding would make it less so with every sample
        for a in range(i):
            P[j, p + a, p + i] = P[j, p + i, p + a]


@inlined
def learn_from(state, y, noise):
    """Take δ_j and P_j of every mode through a measurement; keep its log Λ_j."""
    P, X, Ph, delta = state["P"], state["X"], state["Ph"], state["delta"]
    gain = state["gain"]
    modes, m = len(delta), len(state["gain"])
    n = len(state["moved"])
    p = m - n
    for j in range(modes):
        S = state["spread"][j] + noise
        innovation = y - X[-1, 0] - state["shift"][j]
        state["logarithm"][j] = -0.5 * (np.log(S) + innovation**2 / S)
        root = 1.0 / np.sqrt(S)
        for a in range(p):
            gain[a] = Ph[j, a] * root
        for i in range(n):
            gain[p + i] = 0.0
        for b in range(m):
            for i in range(n):
                gain[p + i] += state["GT"][b, i] * (Ph[j, b] * root)
        for a in range(m):
            delta[j, a] += gain[a] * (root * innovation)
            for b in range(m):
                P[j, a, b] -= gain[a] * gain[b]


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
    """Give every mode the δ⁰ and P⁰ from which it goes on."""
    shares(tuning, state)
    P, delta, share = state["P"], state["delta"], state["share"]
    parted, row = state["parted"], state["row"]
    modes, m = len(delta), len(state["gain"])
    parted[:] = delta
    delta[:] = 0.0
    for j in range(modes):
        for i in range(modes):
            if share[j, i] != 0.0:
                for a in range(m):
                    delta[j, a] += share[j, i] * parted[i, a]
    for a in range(m):
        for j in range(modes):  # rows of the mixed covariances, in the place of the old ones
            mixed_row(state, j, a)
        for j in range(modes):
            for b in range(m):
                P[j, a, b] = row[j, b]


@inlined
def shares(tuning, state):
    """Write c_j = Σ_i Π_ij μ_i, and μ_i|j = Π_ij μ_i/c_j; from a jump a mode goes to quiet only."""
    weight, predicted, share = state["probability"], state["predicted"], state["share"]
    quiet, stay, come = tuning["quiet"], tuning["stay"], tuning["come"]
    predicted[0] = quiet * weight[0]
    for j in range(1, len(weight)):
        predicted[0] += (1.0 - stay) * weight[j]
        predicted[j] = come[j - 1] * weight[0] + stay * weight[j]
    for j in range(len(weight)):
        share[0, j] = (quiet if j == 0 else 1.0 - stay) * weight[j] / predicted[0]
    for j in range(1, len(weight)):
        share[j, 0] = come[j - 1] * weight[0] / predicted[j]
        share[j, j] = stay * weight[j] / predicted[j]


@inlined
def mixed_row(state, j, a):
    """Write row a of P⁰_j beside the old ones."""
    P, delta, share = state["P"], state["delta"], state["share"]
    parted, row = state["parted"], state["row"]
    m = len(state["gain"])
    for b in range(m):
        row[j, b] = 0.0
    for i in range(len(share)):
        if share[j, i] != 0.0:
            apart = parted[i, a] - delta[j, a]
            for b in range(m):
                other = parted[i, b] - delta[j, b]
                row[j, b] += share[j, i] * (P[i, a, b] + apart * other)


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
