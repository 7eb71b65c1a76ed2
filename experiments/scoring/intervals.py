"""Compute confidence intervals from runs with several seeds, and test paired differences.

All intervals have a confidence level of 95 %. With fewer than five seeds, an interval is None,
because the variance cannot be estimated well enough. Only runs with different seeds are
independent. Runs with the same seed at several points of a sweep have the same noise, so `by_seed`
combines these runs before an interval is computed. The test file
`tests/experiments/test_intervals.py` measures the coverage of the intervals.
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

LEAST = 5  # smallest number of values for an interval
NEVER = 1e12  # number that represents infinity
MISS = 0.05  # probability that an interval does not contain the true value
FLOOR = 1e-6
"""Lower limit of scores [s or %]; it replaces smaller scores before a logarithm is computed."""


def t_interval(values: ArrayLike) -> Interval | None:
    """Return Student's t confidence interval for the mean of the values (n,)."""
    x = np.asarray(values, float)
    if len(x) < LEAST or not np.isfinite(x).all():
        return None
    half = 0.0 if _constant(x) else float(_t(len(x)) * stats.sem(x))
    return [float(x.mean()) - half, float(x.mean()) + half]


def mean_interval(values: ArrayLike) -> Interval | None:
    """Return a confidence interval for the mean of values (n,) that have a skewed distribution.

    Hall's transformation of Student's t corrects for skewness (Hall, Journal of the Royal
    Statistical Society B 54, 1992, 221–228). The correction is necessary because the distribution
    of squared errors is skewed. Without the correction, the true mean would lie above a t interval
    more often than below it.
    """
    x = np.asarray(values, float)
    within = t_interval(x)
    if within is None or _constant(x) or abs(skewness := float(stats.skew(x))) < 1e-6:
        return within
    n, ends = len(x), np.array([1.0, -1.0]) * _t(len(x)) / np.sqrt(len(x))
    root = np.cbrt(1 + skewness * (ends - skewness / (6 * n)))
    return list((x.mean() - x.std(ddof=1) * 3 / skewness * (root - 1)).tolist())


def by_seed(values: ArrayLike, seeds: Labels, points: Labels) -> Array:
    """Return one combined value per seed (m,), from which a standard error can be computed.

    The m combined values have the same mean x̄ as the values of the n runs. The scatter of the
    combined values determines the standard error of x̄. For run i, d_i is the deviation of its
    value from the mean at its sweep point. The combined value for a seed is x̄ + m/n Σ d_i, summed
    over the runs with this seed. The formula gives the variance of clustered samples (Cochran,
    *Sampling Techniques*, third edition, chapters 5 and 9). Differences between sweep points are
    not random, and therefore do not increase the scatter. If all sweep points have the same seeds,
    the combined value for a seed is the mean of its values at all sweep points. If any sweep point
    has a single run, the function treats differences between sweep points as random.

    Parameters
    ----------
    values : (n,) array_like
        Value of each run.
    seeds, points : (n,) array_like or None
        Seed and sweep point of each run. If `seeds` is None, each run has a different seed. If
        `points` is None, all runs belong to the same sweep point.
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
    """Return the seed and the sweep point of each run (n,), and the number of runs per point.

    If any sweep point has a single run, the function assigns all runs to one point.
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
    """Return a confidence interval for the median from order statistics; an infinite end is None.

    In the normal approximation for m values, the ends of the interval have the ranks (m + 1)/2 ±
    1.96 √m/2. The ends are interpolated linearly between neighbouring values (Nyblom, Computational
    Statistics and Data Analysis 13, 1992, 33–42). If a seed has several runs, m is the effective
    sample size (Kish, *Survey Sampling*, 1965, section 8.2), which accounts for the correlation
    between the runs.

    Parameters
    ----------
    values, seeds, points : ndarray (n,)
        Values, seeds and sweep points of the runs, as in the function `by_seed`.
    """
    x = np.minimum(np.asarray(values, float), NEVER)
    n = len(x)
    low, high = np.sort(x)[[(n - 1) // 2, n // 2]] if n else (0.0, 0.0)
    share = by_seed(((x <= low) * 1.0 - (x >= high)) / 2, seeds, points)
    if len(share) < LEAST:
        return None
    m = np.clip(0.25 * (len(share) - 1) / max(1e-9, share.var()), len(share), n)
    rank = 0.5 - stats.norm.isf(MISS / 2) / (2 * np.sqrt(m))
    if rank < 0.5 / m:  # the interval between fewer than six values has a coverage below 95 %
        return None
    ends = np.quantile(x, [rank, 1 - rank], method="hazen")
    return [float(end) if end < FLOOR * NEVER else None for end in ends]


def rate_interval(counts: ArrayLike, exposure: float, seeds: ArrayLike) -> Interval:
    """Return a confidence interval for the rate of events per unit of exposure.

    The interval is exact for a Poisson process (Garwood, Biometrika 28, 1936, 437–442). If no event
    occurred, the upper end is the one-sided limit, which is 3.0 divided by the exposure. If events
    occur in clusters, the interval is wider. The width depends on the variance-to-mean ratio of the
    counts per seed.

    Parameters
    ----------
    counts : (n,) array_like
        Number of events in each run.
    exposure : float
        Total exposure of all runs, such as their total duration.
    seeds : (n,) array_like
        Seed of each run.
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
    """Return a confidence interval for the standard deviation that `pooling.spread` returns.

    The total variance is the sum of three variances: within the runs, between the runs at a sweep
    point, and between sweep points. The interval for the variance within the runs is Cox's interval
    for the mean of lognormal values. The interval for the variance between the runs is the χ²
    interval for the variance of normally distributed values, with the degrees of freedom that
    `_freedom` returns. The interval for the variance between sweep points is Student's t interval.
    The method of variance estimates recovery combines the three intervals (Zou and Donner,
    Statistical Methods in Medical Research 17, 2008, 1–10).

    Parameters
    ----------
    std, bias : (n,) array_like
        Root mean square and mean of the error in each run.
    seeds, points : (n,) array_like, optional
        Seeds and sweep points of the runs, as in the function `by_seed`.
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
    """Return the degrees of freedom of the variance between the runs at each sweep point.

    Satterthwaite's formula is (m − 1)(tr C)²/tr C², where C is the covariance between the sweep
    points, estimated from m seeds. The formula gives m − 1 degrees of freedom if the noise is the
    same at all sweep points. If the noise is independent from sweep point to sweep point, the
    formula gives the number of sweep points times m − 1. The function subtracts the bias of tr C²
    due to the finite number of seeds.
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
    """Return Cox's confidence interval for the mean of lognormal values (n,)."""
    if values.min() <= FLOOR * values.mean():  # the values of a constant run are not lognormal
        return mean_interval(values)
    logs, n = np.log(values), len(values)
    v = logs.var(ddof=1)
    half = _t(n) * np.sqrt(v / n + v**2 / (2 * (n - 1)))
    return np.exp(logs.mean() + v / 2 + half * np.array([-1, 1]))


def pseudo_values(statistic: Callable[[Any], float], n: int) -> Array:
    """Return the jackknife pseudo-values (n,) of a statistic of n runs.

    The mean of the pseudo-values is the bias-corrected statistic. The scatter of the pseudo-values
    determines the standard error of the statistic (Tukey, Annals of Mathematical Statistics 29,
    1958, 614). The statistic can combine several quantities of the same runs. The pseudo-values of
    two statistics of the same runs are paired.

    Parameters
    ----------
    statistic : callable
        Function that receives the indices of some runs and returns the statistic of these runs.
    n : int
        Number of runs. For a single run, the pseudo-value is the statistic itself.
    """
    every = np.arange(n)
    whole = statistic(every)
    if n < 2:
        return np.full(n, whole)
    return np.array([n * whole - (n - 1) * statistic(np.delete(every, i)) for i in every])


def _constant(values: Array) -> bool:
    """Return whether the values differ only by rounding errors."""
    return bool(np.ptp(values) <= 1e-12 * max(1e-300, float(np.abs(values).max())))


def _t(n: int) -> float:
    return float(stats.t.isf(MISS / 2, n - 1))


def sign_p(more: int, less: int) -> float:
    """Return the one-sided p-value of McNemar's exact test for two paired estimators.

    The p-value is the probability of at least `more` heads in `more` + `less` tosses of a fair
    coin. The test uses only runs that are lost (diverged or never settled) for exactly one of the
    two estimators. If the estimators are equally good, each of them loses half of these runs on
    average.

    Examples
    --------
    >>> sign_p(10, 0) == 2**-10, sign_p(0, 3)
    (True, 1.0)
    """
    return float(stats.binom.sf(more - 1, more + less, 0.5))


def holm_levels(p: ArrayLike, alpha: float) -> Array:
    """Return the significance level of each test according to Holm's step-down procedure.

    The procedure rejects a hypothesis if the p-value of its test is at most the level of this test.
    A hypothesis is rejected if and only if the confidence interval at the level of its test
    excludes zero. The probability of any wrong rejection is at most `alpha`, even if the tests are
    dependent.

    Parameters
    ----------
    p : array_like (m,)
        p-values of the tests. A test with the p-value NaN is ignored, and its level is `alpha`.
    alpha : float
        Family-wise error rate.

    Returns
    -------
    ndarray (m,)
        Level of each test: alpha/m for the smallest p-value, alpha/(m − 1) for the next p-value,
        and so on. Once a hypothesis is not rejected, all later hypotheses are tested at the same
        level as that one.

    Examples
    --------
    >>> holm_levels([0.2, 0.001, 0.03], 0.06).round(3).tolist()
    [0.06, 0.02, 0.03]
    """
    p = np.asarray(p, float)
    order, members = np.argsort(p), np.isfinite(p).sum()  # NaN sorts last
    steps = alpha / np.arange(members, 0, -1)
    rejected = p[order[:members]] <= steps
    first = members - 1 if rejected.all() else np.argmin(rejected)
    levels = np.full(len(p), alpha)
    levels[order[:members]] = steps[np.minimum(np.arange(members), first)]
    return levels


def difference(first: ArrayLike, second: ArrayLike) -> tuple[int, float, float]:
    """Return the number and mean of the paired differences, and the p-value of a paired t test.

    Parameters
    ----------
    first, second : array_like (n,) of float or None
        Scores of two estimators for the same seeds. Undefined values are None or NaN.
    """
    d = np.array(first, float) - np.array(second, float)
    d = d[~np.isnan(d)]
    mean = float(d.mean()) if d.size else 0.0
    if d.size < 2 or np.ptp(d) <= 1e-12:  # equal up to rounding, or one pair only
        return d.size, mean, float(d.size < 2 or abs(mean) <= 1e-12)
    return d.size, mean, float(stats.ttest_1samp(d, 0.0).pvalue)
