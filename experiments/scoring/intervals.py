"""Intervals over seeds, and tests of paired runs.

All intervals are at 95 %, and None below five seeds, because fewer do not show the spread. A seed
is one draw: its runs at several points of a sweep share their noise, so they are first averaged
seed by seed (`by_seed`). `tests/experiments/test_intervals.py` measures
the coverage.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy import stats

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Interval = list[float]
Labels = ArrayLike | None

LEAST = 5  # values below which there is no interval
NEVER = 1e12  # stands for infinity
MISS = 0.05  # chance that an interval leaves out what it is for
FLOOR = 1e-6
"""Values below this [s or %] count as this in a logarithm: whoever never moves has a std of 0."""


def t_interval(values: ArrayLike) -> Interval | None:
    """Return the interval of the mean of values (n,) by Student's t."""
    x = np.asarray(values, float)
    if len(x) < LEAST or not np.isfinite(x).all():
        return None
    half = 0.0 if _constant(x) else float(_t(len(x)) * stats.sem(x))
    return [float(x.mean()) - half, float(x.mean()) + half]


def mean_interval(values: ArrayLike) -> Interval | None:
    """Return the interval of the mean of the distribution of values (n,).

    Student's t with Hall's transformation, which takes the skewness out (P. Hall, J. R. Statist.
    Soc. B 54, 1992, 221–228): a squared error is skewed, and t alone would miss on one side.
    """
    x = np.asarray(values, float)
    within = t_interval(x)
    if within is None or _constant(x) or abs(skewness := float(stats.skew(x))) < 1e-6:
        return within
    n, ends = len(x), np.array([1.0, -1.0]) * _t(len(x)) / np.sqrt(len(x))
    root = np.cbrt(1 + skewness * (ends - skewness / (6 * n)))
    return list((x.mean() - x.std(ddof=1) * 3 / skewness * (root - 1)).tolist())


def by_seed(values: ArrayLike, seeds: Labels, points: Labels) -> Array:
    """Return what each of m seeds says of the mean of values over fixed points: (m,).

    Their mean is that of the values, and their scatter that of it: of a seed with the deviations
    d_i = x_i − x̄ of its point, x̄ + m/n Σ d_i, the variance of clusters (W. G. Cochran, *Sampling
    Techniques*, 3rd ed., chapters 5 and 9). The levels of points are no draws. With the same seeds
    at all points it is the mean over points, seed by seed. Where a point has a single run, the
    points are draws themselves.

    Parameters
    ----------
    values : (n,) array_like
    seeds, points : (n,) array_like or None
        Of the runs; points by any number that tells them apart. Without, each value is of a seed
        of its own, and all are of one point.
    """
    x = np.asarray(values, float)
    seed, point, runs = _labels(seeds, points, len(x))
    m = len(np.unique(seed))
    if m == len(x) and len(runs) < 2:
        return x
    apart = x - (np.bincount(point, weights=x) / runs)[point]
    apart *= np.sqrt(runs / (runs - 1) * (m - 1) / m)[point]
    return np.asarray(x.mean() + m / len(x) * np.bincount(seed, weights=apart))


def _labels(seeds: Labels, points: Labels, n: int) -> tuple[Index, Index, Index]:
    """Return the numbers (n,) of seed and point of each run, and the runs at each point.

    All are of one point where any point has a single run.
    """
    seed = np.unique(np.arange(n) if seeds is None else seeds, return_inverse=True)[1]
    point = np.unique(np.zeros(n) if points is None else points, return_inverse=True)[1]
    runs = np.bincount(point)
    if n and runs.min() < 2:
        point, runs = np.zeros_like(point), np.array([n])
    return seed, point, runs


def median_interval(
    values: ArrayLike, seeds: Labels = None, points: Labels = None
) -> list[float | None] | None:
    """Return the interval of the median by order statistics; an end at infinity is None.

    Their ranks are those of the normal approximation, (m + 1)/2 ± 1.96 √m/2, straight between two
    values (J. Nyblom, Comput. Stat. Data Anal. 13, 1992, 33–42, on interpolating them). Where seeds
    come more than once, m is the number of independent values that would leave the share of those
    below the median as uncertain as it is (L. Kish, *Survey Sampling*, 1965, section 8.2).

    Parameters
    ----------
    values, seeds, points
        As for `by_seed`.
    """
    x = np.minimum(np.asarray(values, float), NEVER)
    n = len(x)
    low, high = np.sort(x)[[(n - 1) // 2, n // 2]] if n else (0.0, 0.0)
    share = by_seed(((x <= low) * 1.0 - (x >= high)) / 2, seeds, points)
    if len(share) < LEAST:
        return None
    m = np.clip(0.25 * (len(share) - 1) / max(1e-9, share.var()), len(share), n)
    rank = 0.5 - stats.norm.isf(MISS / 2) / (2 * np.sqrt(m))
    if rank < 0.5 / m:  # six values are the fewest that hold the median so surely
        return None
    ends = np.quantile(x, [rank, 1 - rank], method="hazen")
    return [float(end) if end < FLOOR * NEVER else None for end in ends]


def rate_interval(counts: ArrayLike, exposure: float, seeds: ArrayLike) -> Interval:
    """Return the interval of a rate of events, over the unit of the exposure.

    The exact one of a Poisson process (F. Garwood, Biometrika 28, 1936, 437–442); of no event the
    one-sided limit, 3.0 over the exposure. Where events come in storms, each counts for less, by
    the dispersion of the counts of seeds.

    Parameters
    ----------
    counts : (n,) array_like
        Of the runs.
    exposure : float
        Of all of them together.
    seeds : (n,) array_like
        Of the runs.
    """
    each = pd.Series(counts, dtype=float).groupby(np.asarray(seeds)).sum()
    total, miss = float(each.sum()), MISS / 2
    if not total:
        return [0.0, float(stats.gamma.isf(MISS, 1) / exposure)]
    storm = max(1.0, each.var() / each.mean()) if len(each) > 1 else 1.0
    k = total / storm
    ends = stats.gamma.ppf(miss, k), stats.gamma.isf(miss, k + 1)
    return [float(storm * end / exposure) for end in ends]


def spread_interval(
    std: ArrayLike, bias: ArrayLike, seeds: Labels = None, points: Labels = None
) -> Interval | None:
    """Return the interval of the standard deviation over time and runs, as `pooling.spread` has it.

    The variance is that within the runs, that of their means about those of their points, and that
    of these. The first has the interval of the mean of lognormal values (Cox's), the second that
    of a normal variance (χ², with the degrees of freedom of `_freedom`), the third a normal one;
    and the sum theirs, put together by recovery of variances (G. Y. Zou and A. Donner, Stat.
    Methods Med. Res. 17, 2008, 1–10).

    Parameters
    ----------
    std, bias : (n,) array_like
        Root mean square about zero, and mean, of each run.
    seeds, points : (n,) array_like, optional
        As for `by_seed`.
    """
    rms, mean = np.asarray(std, float), np.asarray(bias, float)
    seed, point, runs = _labels(seeds, points, len(rms))
    if len(np.unique(seed)) < LEAST or not np.isfinite([rms, mean]).all():
        return None
    level = (np.bincount(point, weights=mean) / runs)[point]
    within = by_seed(np.maximum(rms**2 - mean**2, 0.0), seed, point)
    apart = mean - level if not _constant(mean) else np.zeros_like(mean)
    between = float(np.mean(apart**2 * (runs / (runs - 1))[point]))
    freedom, off = _freedom(apart, seed, point), level - mean.mean()
    of_levels = np.array(t_interval(by_seed(2 * off * apart, seed, point)))
    parts = np.array([
        [within.mean(), *_cox(within)],
        [between, *(between * freedom / stats.chi2.isf([MISS / 2, 1 - MISS / 2], freedom))],
        [np.mean(off**2), *(np.mean(off**2) + of_levels)],
    ])  # fmt: skip
    half = np.sqrt(np.sum((parts[:, 1:] - parts[:, :1]) ** 2, axis=0))
    low, high = np.maximum(0.0, parts[:, 0].sum() + half * [-1, 1])
    return [float(np.sqrt(low)), float(np.sqrt(high))]


def _freedom(apart: Array, seed: Index, point: Index) -> float:
    """Return the degrees of freedom of the mean square of what runs differ from their points by.

    Satterthwaite's, (m − 1)(tr C)²/tr C² of the covariance C of the points over m seeds: m − 1
    where all points share their noise, as many times more as there are points where they do not.
    tr C² is less by what chance adds to it.
    """
    table = np.zeros((seed.max() + 1, point.max() + 1))
    table[seed, point] = apart
    C = table.T @ table
    m, whole, square = len(table), float(np.trace(C)) ** 2, float((C * C).sum())
    if square == 0 or len(C) == 1:
        return m - 1
    square -= (whole - square) / (m - 1)
    return min((m - 1) * whole / max(square, whole / len(C)), len(apart) - len(C))


def _cox(values: Array) -> Any:
    """Return the interval of the mean of lognormal values (n,)."""
    if values.min() <= FLOOR * values.mean():  # a run does not scatter at all: not lognormal
        return mean_interval(values)
    logs, n = np.log(values), len(values)
    v = logs.var(ddof=1)
    half = _t(n) * np.sqrt(v / n + v**2 / (2 * (n - 1)))
    return np.exp(logs.mean() + v / 2 + half * np.array([-1, 1]))


def pseudo_values(statistic: Callable[[Any], float], n: int) -> Array:
    """Return what each of n runs says of a statistic of all of them: the jackknife's values (n,).

    Their mean is the statistic less its bias, and their scatter that of the statistic, also where
    it is made of several quantities of the same runs; values of two statistics of the same runs
    are paired (J. W. Tukey, Ann. Math. Statist. 29, 1958, 614).

    Parameters
    ----------
    statistic : callable
        ``statistic(indices)`` of the runs with these indices.
    n : int
        Number of runs; of a single one it is the statistic itself.
    """
    every = np.arange(n)
    whole = statistic(every)
    if n < 2:
        return np.full(n, whole)
    return np.array([n * whole - (n - 1) * statistic(np.delete(every, i)) for i in every])


def _constant(values: Array) -> bool:
    """Whether values differ by rounding errors only."""
    return bool(np.ptp(values) <= 1e-12 * max(1e-300, float(np.abs(values).max())))


def _t(n: int) -> float:
    return float(stats.t.isf(MISS / 2, n - 1))


def sign_p(more: int, less: int) -> float:
    """Return the one-sided p of McNemar's exact test: the probability of at least `more` heads.

    Runs that both sides win or lose tell nothing; each of the others is as likely lost by either
    side if neither is better, so `more` of more + less is binomial(½).

    Examples
    --------
    >>> sign_p(10, 0) == 2**-10, sign_p(0, 3)
    (True, 1.0)
    """
    return float(stats.binom.sf(more - 1, more + less, 0.5))


def holm_levels(p: ArrayLike, alpha: float) -> Array:
    """Return the level that Holm's step-down procedure gives to each test.

    A test with p ≤ its level is rejected, and an interval at this level leaves out zero exactly
    then. The probability of any wrong rejection is at most `alpha`, however the tests depend on
    each other.

    Parameters
    ----------
    p : array_like (m,)
        p-values. NaN is no member of the family, and gets `alpha`.
    alpha : float
        Level of the family.

    Returns
    -------
    ndarray (m,)
        alpha/m for the smallest p, alpha/(m − 1) for the next, …; the tests after the first that is
        not rejected all have its level.

    Examples
    --------
    >>> holm_levels([0.2, 0.001, 0.03], 0.06).round(3).tolist()
    [0.06, 0.02, 0.03]
    """
    p = np.asarray(p, float)
    order, members = np.argsort(p), np.isfinite(p).sum()  # NaN comes last
    steps = alpha / np.arange(members, 0, -1)
    rejected = p[order[:members]] <= steps
    first = members - 1 if rejected.all() else np.argmin(rejected)
    levels = np.full(len(p), alpha)
    levels[order[:members]] = steps[np.minimum(np.arange(members), first)]
    return levels


def difference(first: ArrayLike, second: ArrayLike) -> tuple[int, float, float]:
    """Return number and mean of paired differences first − second, and p of Student's t test.

    Parameters
    ----------
    first, second : array_like (n,) of float or None
        A score seed by seed; None or NaN where there is none.
    """
    d = np.array(first, float) - np.array(second, float)
    d = d[~np.isnan(d)]
    mean = float(d.mean()) if d.size else 0.0
    if d.size < 2 or np.ptp(d) <= 1e-12:  # equal but for rounding, or one pair alone
        return d.size, mean, float(d.size < 2 or abs(mean) <= 1e-12)
    return d.size, mean, float(stats.ttest_1samp(d, 0.0).pvalue)
