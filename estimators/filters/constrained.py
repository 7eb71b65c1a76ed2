"""
What the data do not contradict is as it was told: estimates given that, in compiled code.

A filter that learns many parameters pays for each in the variance of the others, also where there
was nothing to learn. With μ and Σ of all of them, and a group s of parameters told to be s₀, let
χ² = (μ_s − s₀)ᵀ Σ_ss⁻¹ (μ_s − s₀). The estimate given s = s₀ is μ + Σ_·s Σ_ss⁻¹ (s₀ − μ_s), and the
estimate is taken so far towards it as it is likely,

    w = 1/(1 + exp(½(χ² − c))),

with c the 95 % quantile of χ² for so many parameters. These are Akaike's weights but for c (K. P.
Burnham and D. R. Anderson, *Model selection and multimodel inference*, 2002, §2.9): a told value
that is wrong draws an estimate by no more than its own √c standard deviations or so, whereas Bayes
factors would hold on to it until far later. Groups follow each other, each given those before. The
filter itself is left alone. To the covariance of the estimate each group adds w(1 − w) d dᵀ, d the
difference of the two estimates, as of any mixture.
"""

from collections.abc import Sequence

import numpy as np

from flexaxis.estimators.filters.loop import Record, record
from flexaxis.estimators.models.compiler import inlined

LEVEL = 0.95  # of χ², at which what was told and what was learnt weigh the same


def told_records(
    tracked: int, groups: Sequence[tuple[Sequence[int], Sequence[float]]]
) -> tuple[Record, Record]:
    """
    Return what `draw_estimates` needs of tuning and state.

    Parameters
    ----------
    tracked : int
        The first so many of θ are estimates.
    groups : sequence of (indices, values)
        Of θ, and where it was told to be; in units of θ.
    """
    from scipy.stats import chi2  # takes a third of a second to import

    union = np.unique(np.concatenate([np.arange(tracked), *(i for i, _ in groups)])).astype(int)
    most = max([1, *(len(i) for i, _ in groups)])
    members, values = (
        np.full((max(1, len(groups)), most), -1),
        np.zeros((max(1, len(groups)), most)),
    )
    limit = np.zeros(len(members))
    for row, (indices, told) in enumerate(groups):
        members[row, : len(indices)] = np.searchsorted(union, indices)
        values[row, : len(indices)] = told
        limit[row] = chi2.ppf(LEVEL, len(indices))
    tuning = record(union=union, members=members, told=values, limit=limit)
    state = record(
        given=np.zeros(len(union)),
        given_P=np.zeros((len(union), len(union))),
        given_between=np.zeros((len(union), len(union))),
        factor=np.zeros((most, most)),
        towards=np.zeros((most, len(union))),
        apart_told=np.zeros(most),
        told_share=np.zeros(len(limit)),
    )
    return tuning, state


@inlined
def draw_estimates(tuning, state, P, theta, estimates):
    """
    Write estimates (q,) given what was told, as far as the data do not contradict it.

    θ (p,) and P are what is thought without it. Of all that is given, ``given_P + given_between``
    is the covariance.
    """
    union, given, given_P = tuning["union"], state["given"], state["given_P"]
    for a in range(len(union)):
        given[a] = theta[union[a]]
        for b in range(a + 1):
            given_P[a, b] = given_P[b, a] = P[union[a], union[b]]
    state["given_between"][:] = 0.0
    for g in range(len(state["told_share"])):
        state["told_share"][g] = _draw(tuning, state, g)
    for i in range(len(estimates)):
        estimates[i] = given[i]


@inlined
def _draw(tuning, state, g):
    """Draw what is thought towards one group as it was told, and return how far."""
    members, told, L = tuning["members"], tuning["told"], state["factor"]
    given, P, W = state["given"], state["given_P"], state["towards"]
    e = state["apart_told"]
    k = 0
    while k < len(L) and members[g, k] >= 0:
        k += 1
    square = 0.0
    for i in range(k):  # L Lᵀ = Σ_ss, W = L⁻¹ Σ_s·, and e = L⁻¹ (s₀ − μ_s)
        _factorize(members[g], P, L, i)
        known = L[i, i] <= 0.0  # it is as it was told already
        e[i] = 0.0 if known else told[g, i] - given[members[g, i]]
        for a in range(len(given)):
            W[i, a] = 0.0 if known else P[members[g, i], a]
        for c in range(0 if known else i):
            e[i] -= L[i, c] * e[c]
            for a in range(len(given)):
                W[i, a] -= L[i, c] * W[c, a]
        if not known:
            e[i] /= L[i, i]
            for a in range(len(given)):
                W[i, a] /= L[i, i]
        square += e[i] ** 2
    share = 1.0 / (1.0 + np.exp(min(0.5 * (square - tuning["limit"][g]), 100.0)))
    _draw_to(state, k, share)
    return share


@inlined
def _draw_to(state, k, share):
    """Take the estimates a share of the way, and what is known of them."""
    given, P, between = state["given"], state["given_P"], state["given_between"]
    W, e = state["towards"], state["apart_told"]
    spread = share * (1.0 - share)
    for i in range(k):
        for j in range(k):
            for a in range(len(given)):
                for b in range(len(given)):
                    between[a, b] += spread * e[i] * e[j] * W[i, a] * W[j, b]
    for i in range(k):
        for a in range(len(given)):
            given[a] += share * W[i, a] * e[i]
            for b in range(len(given)):
                P[a, b] -= share * W[i, a] * W[i, b]


@inlined
def _factorize(members, P, L, i):
    """Write row i of the Cholesky factor of Σ_ss; zero where nothing is left to vary."""
    for j in range(i):
        total = P[members[i], members[j]]
        for c in range(j):
            total -= L[i, c] * L[j, c]
        L[i, j] = total / L[j, j] if L[j, j] > 0.0 else 0.0
    left = P[members[i], members[i]]
    for c in range(i):
        left -= L[i, c] ** 2
    L[i, i] = np.sqrt(left) if left > 1e-9 * P[members[i], members[i]] else 0.0
