"""
Shrinkage of parameter estimates towards nominal values, unless the data contradict these values.

Each additional parameter that a filter estimates increases the variance of all other estimates,
even if the nominal value of the additional parameter is correct. Let μ be the filter's estimate of
all parameters, and let Σ be the covariance of μ. Let s₀ be the nominal values of a parameter group
s. The normalised squared deviation of the estimate from s₀ is χ² = (μ_s − s₀)ᵀ Σ_ss⁻¹ (μ_s − s₀).
If the nominal values s₀ are taken as exact, the conditional estimate of all parameters is μ + Σ_·s
Σ_ss⁻¹ (s₀ − μ_s). The shrunk estimate is a weighted mean of the filter's estimate μ and the
conditional estimate given s₀. The following formula gives the weight w of the conditional estimate:

    w = 1/(1 + exp(½(χ² − c))),

The constant c is the 95 % quantile of the χ² distribution with one degree of freedom for each
parameter in the group. If the constant c were twice the number of parameters in the group, the
weight w would be the Akaike weight defined in section 2.9 of *Model selection and multimodel
inference* (Burnham and Anderson, 2002). A wrong nominal value shifts an estimate by at most about
√c standard deviations, where c is the 95 % quantile of the χ² distribution. If the weights were
Bayes factors, the estimates would remain near a wrong nominal value for far longer. The estimates
are shrunk one parameter group at a time. The shrinkage does not change the filter state. For each
parameter group, the term w(1 − w) d dᵀ is added to the covariance, where w is the weight of the
conditional estimate, and d is the difference between the conditional estimate and the filter's
estimate μ.
"""

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.state import subtract
from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.models.memory import Indices, Matrix, Vector

LEVEL = 0.95  # quantile of χ² at which nominal values and data have equal weights
SETTLED = 1e-9  # a conditional variance counts as zero if it is below this fraction of the variance


class Told(NamedTuple):
    """
    Nominal values of parameter groups, and the estimates that are shrunk towards these values.

    Attributes
    ----------
    union : (u,) array
        Indices in θ of the parameters that are tracked or belong to a parameter group.
    members, values : (groups, most) arrays
        Position of each group member in ``union``, padded with −1, and nominal value of each group
        member.
    limit : (groups,) array
        Quantile c of the χ² distribution for each parameter group.
    drawn : (u,) array
        Parameter estimates after shrinkage towards the nominal values.
    mean, column : (u,) arrays
        Estimate given the nominal values of the current group, and column of P that belongs to the
        current parameter.
    drawn_P, drawn_between : (u, u) arrays
        Weighted mean of the covariances of two estimates (the filter's estimate and the conditional
        estimate), and the covariance due to the difference between these two estimates. The sum of
        ``drawn_P`` and ``drawn_between`` is the covariance of ``drawn``.
    P : (u, u) array
        Covariance of the estimate given the nominal values of the current group.
    """

    union: Indices
    members: Annotated[NDArray[np.int64], np.dtype(np.int64), 2]
    values: Matrix
    limit: Vector
    drawn: Vector
    mean: Vector
    column: Vector
    drawn_P: Matrix
    drawn_between: Matrix
    P: Matrix


def told_arrays(
    tracked: int, groups: Sequence[tuple[Sequence[int], Sequence[float]]]
) -> dict[str, NDArray]:
    """
    Return the arrays of a `Told` tuple in a dictionary keyed by array name.

    Parameters
    ----------
    tracked : int
        Number of tracked parameters, which are the first elements of θ.
    groups : sequence of (indices, values)
        For each parameter group, the indices of its parameters in θ and their nominal values, in
        the units of θ.
    """
    from scipy.stats import chi2  # takes a third of a second to import

    union = np.unique(np.concatenate([np.arange(tracked), *(i for i, _ in groups)])).astype(int)
    most = max([1, *(len(i) for i, _ in groups)])
    shape = max(1, len(groups)), most
    members, values, limit = np.full(shape, -1), np.zeros(shape), np.zeros(shape[0])
    for row, (indices, told) in enumerate(groups):
        members[row, : len(indices)] = np.searchsorted(union, indices)
        values[row, : len(indices)] = told
        limit[row] = chi2.ppf(LEVEL, len(indices))
    u = len(union)
    return (
        {"union": union, "members": members, "told": values, "limit": limit}
        | dict.fromkeys(("drawn", "told_mean", "column"), np.zeros(u))
        | dict.fromkeys(("drawn_P", "drawn_between", "told_P"), np.zeros((u, u)))
    )


@inlined
def draw_estimates(told, P, theta, estimates):
    """
    Shrink the filter's estimates towards nominal values, and write the result to `estimates` (q,).

    The arguments are the filter's estimates θ (p,) and their covariance P before the shrinkage. The
    covariance of the shrunk estimates is ``drawn_P + drawn_between``.
    """
    union, drawn, drawn_P = told.union, told.drawn, told.drawn_P
    for a in range(len(union)):
        drawn[a] = theta[union[a]]
        for b in range(a + 1):
            drawn_P[a, b] = drawn_P[b, a] = P[union[a], union[b]]
    told.drawn_between[:] = 0.0
    for g in range(len(told.limit)):
        _draw(told, g)
    for i in range(len(estimates)):
        estimates[i] = drawn[i]


@inlined
def _draw(told, g):
    """
    Shrink the estimates towards the nominal values of one parameter group.

    The function treats each nominal value in turn as a noise-free measurement, which yields the
    estimate given the nominal values. The function skips a parameter with zero conditional
    variance, because the previous nominal values already determine this parameter.
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
        subtract(C, column, 1.0 / variance)
    share = 1.0 / (1.0 + np.exp(min(0.5 * (square - told.limit[g]), 100.0)))
    for a in range(len(drawn)):
        for b in range(len(drawn)):
            apart = (mean[a] - drawn[a]) * (mean[b] - drawn[b])
            between[a, b] += share * (1.0 - share) * apart
            P[a, b] += share * (C[a, b] - P[a, b])
    for a in range(len(drawn)):
        drawn[a] += share * (mean[a] - drawn[a])
