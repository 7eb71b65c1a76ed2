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
SETTLED = 1e-9  # of a variance, below which nothing is left of it


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
        told_mean=np.zeros(len(union)),
        told_P=np.zeros((len(union), len(union))),
        column=np.zeros(len(union)),
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
    """
    Draw what is thought towards one group as it was told, and return how far.

    The group is a measurement without noise of one parameter after the other; what varies no more
    given those before is as it was told already.
    """
    given, P, between = state["given"], state["given_P"], state["given_between"]
    mean, C, column = state["told_mean"], state["told_P"], state["column"]
    for a in range(len(given)):
        mean[a] = given[a]
        for b in range(len(given)):
            C[a, b] = P[a, b]
    square = 0.0
    for i in range(tuning["members"].shape[1]):
        m = tuning["members"][g, i]
        if m < 0 or C[m, m] <= SETTLED * P[m, m]:
            continue
        for a in range(len(given)):
            column[a] = C[a, m]
        e, variance = tuning["told"][g, i] - mean[m], column[m]
        square += e**2 / variance
        for a in range(len(given)):
            mean[a] += column[a] * e / variance
            for b in range(len(given)):
                C[a, b] -= column[a] * column[b] / variance
    share = 1.0 / (1.0 + np.exp(min(0.5 * (square - tuning["limit"][g]), 100.0)))
    for a in range(len(given)):
        for b in range(len(given)):
            apart = (mean[a] - given[a]) * (mean[b] - given[b])
            between[a, b] += share * (1.0 - share) * apart
            P[a, b] += share * (C[a, b] - P[a, b])
    for a in range(len(given)):
        given[a] += share * (mean[a] - given[a])
    return share
