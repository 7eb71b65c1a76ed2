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
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.models.memory import Indices, Matrix, Vector

LEVEL = 0.95  # of χ², at which what was told and what was learnt weigh the same
SETTLED = 1e-9  # of a variance, below which nothing is left of it


class Told(NamedTuple):
    """
    What was told of parameters, and estimates given that.

    Attributes
    ----------
    union : (u,) array
        Which of θ are estimates, or in a group.
    members, values : (groups, most) arrays
        Of each group: its places in the union, −1 for none, and what was told.
    limit : (groups,) array
        c.
    drawn : (u,) array
        The estimate; drawn_P + drawn_between is its covariance.
    drawn_P, drawn_between, P : (u, u) arrays
    mean, column : (u,) arrays
    share : (groups,) array
        w.
    """

    union: Indices
    members: Annotated[NDArray[np.int64], np.dtype(np.int64), 2]
    values: Matrix
    limit: Vector
    drawn: Vector
    drawn_P: Matrix
    drawn_between: Matrix
    mean: Vector
    P: Matrix
    column: Vector
    share: Vector


def told_arrays(
    tracked: int, groups: Sequence[tuple[Sequence[int], Sequence[float]]]
) -> dict[str, NDArray]:
    """
    Return what `draw_estimates` needs, by name.

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
    q, square = np.zeros(len(union)), np.zeros((len(union), len(union)))
    return {
        "union": union,
        "members": members,
        "told": values,
        "limit": limit,
        "drawn": q,
        "drawn_P": square,
        "drawn_between": square,
        "told_mean": q,
        "told_P": square,
        "column": q,
        "told_share": np.zeros(len(limit)),
    }


@inlined
def draw_estimates(told, P, theta, estimates):
    """
    Write estimates (q,) given what was told, as far as the data do not contradict it.

    θ (p,) and P are what is thought without it. Of all that is given, ``drawn_P + drawn_between``
    is the covariance.
    """
    union, drawn, drawn_P = told.union, told.drawn, told.drawn_P
    for a in range(len(union)):
        drawn[a] = theta[union[a]]
        for b in range(a + 1):
            drawn_P[a, b] = drawn_P[b, a] = P[union[a], union[b]]
    told.drawn_between[:] = 0.0
    for g in range(len(told.share)):
        told.share[g] = _draw(told, g)
    for i in range(len(estimates)):
        estimates[i] = drawn[i]


@inlined
def _draw(told, g):
    """
    Draw what is thought towards one group as it was told, and return how far.

    The group is a measurement without noise of one parameter after the other; what varies no more
    given those before is as it was told already.
    """
    drawn, P, between = told.drawn, told.drawn_P, told.drawn_between
    mean, C, column = told.mean, told.P, told.column
    for a in range(len(drawn)):
        mean[a] = drawn[a]
        for b in range(len(drawn)):
            C[a, b] = P[a, b]
    square = 0.0
    for i in range(told.members.shape[1]):
        m = told.members[g, i]
        if m < 0 or C[m, m] <= SETTLED * P[m, m]:
            continue
        for a in range(len(drawn)):
            column[a] = C[a, m]
        e, variance = told.values[g, i] - mean[m], column[m]
        square += e**2 / variance
        for a in range(len(drawn)):
            mean[a] += column[a] * e / variance
            for b in range(len(drawn)):
                C[a, b] -= column[a] * column[b] / variance
    share = 1.0 / (1.0 + np.exp(min(0.5 * (square - told.limit[g]), 100.0)))
    for a in range(len(drawn)):
        for b in range(len(drawn)):
            apart = (mean[a] - drawn[a]) * (mean[b] - drawn[b])
            between[a, b] += share * (1.0 - share) * apart
            P[a, b] += share * (C[a, b] - P[a, b])
    for a in range(len(drawn)):
        drawn[a] += share * (mean[a] - drawn[a])
    return share
