"""Intervals over seeds, and tests of paired runs.

All are at 95 % and None below five seeds: of fewer nobody can say how far they spread. A seed is
one draw: runs of one seed at several points of a sweep share their noise, and what is pooled over
them is first put together seed by seed (`by_seed`). `tests/experiments/test_intervals.py` measures
the coverage.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Interval = list[float]
Labels = ArrayLike | None

LEAST = 5  # values below which there is no interval
MISS = 0.05  # chance that an interval leaves out what it is for
FLOOR = 1e-6
"""Values below this [s or %] count as this in a logarithm: whoever never moves has a std of 0."""


def mean_interval(values: ArrayLike) -> Interval | None:
    """Return the interval of the mean of what the values (n,) were drawn from.

    Student's t with Hall's transformation, which takes the skewness out (P. Hall, J. R. Statist.
    Soc. B 54, 1992, 221–228): a squared error is skewed, and t alone would miss on one side.
    """
    x = np.asarray(values, float)
    if not _enough(x):
        return None
    if _constant(x):
        return [float(x.mean())] * 2
    n, skewness = len(x), stats.skew(x)
    ends = np.array([1.0, -1.0]) * _t(n) / np.sqrt(n)
    if abs(skewness) > 1e-6:  # else the limit of what follows
        root = np.cbrt(1 + skewness * (ends - skewness / (6 * n)))
        ends = 3 / skewness * (root - 1)
    return list((x.mean() - x.std(ddof=1) * ends).tolist())


def log_interval(values: ArrayLike) -> Interval | None:
    """Return the interval of the geometric mean of positive values: Student's t on logarithms."""
    within = t_interval(np.log(np.maximum(np.asarray(values, float), FLOOR)))
    return within and list(np.exp(within).tolist())


def t_interval(values: ArrayLike) -> Interval | None:
    """Return the interval of the mean of values (n,) by Student's t."""
    x = np.asarray(values, float)
    if not _enough(x):
        return None
    half = 0.0 if _constant(x) else float(_t(len(x)) * stats.sem(x))
    return [float(x.mean()) - half, float(x.mean()) + half]


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

    Where seeds come more than once, of as many independent values as would leave the share of
    those below the median as uncertain as it is (`_independent`).

    Parameters
    ----------
    values, seeds, points
        As for `by_seed`.
    """
    each = np.asarray(values, float)
    x, n = np.sort(each), len(each)
    m = n
    if seeds is not None and len(np.unique(seeds)) < n:
        low, high = x[[(n - 1) // 2, n // 2]]
        below = ((each <= low) * 1.0 - (each >= high)) / 2
        m = int(_independent(below, 0.25, seeds, points))
    rank = int(stats.binom.ppf(MISS / 2, m, 0.5)) * n // m if m >= LEAST else 0
    if rank < 1:  # six values are the fewest that hold the median so surely
        return None
    return [float(v) if np.isfinite(v) else None for v in (x[rank - 1], x[n - rank])]


def _independent(values: Array, variance: float, seeds: Labels, points: Labels) -> float:
    """Return of how many independent values with a variance the mean would be as uncertain.

    L. Kish, *Survey Sampling*, 1965, section 8.2; as many as there are seeds at least.
    """
    n, m = len(values), len(np.unique(np.asarray(seeds)))
    of_mean = float(by_seed(values, seeds, points).var(ddof=1)) / m if m > 1 else 0.0
    return float(np.clip(variance / of_mean, m, n)) if of_mean > 0 else n


def share_interval(yes: ArrayLike, seeds: Labels = None, points: Labels = None) -> Interval:
    """Return the interval of a share of runs (C. J. Clopper and E. S. Pearson, 1934).

    Where seeds come more than once, of as many independent runs as are as uncertain; a share of
    none or all tells nothing of that, and then each seed counts once.

    Parameters
    ----------
    yes, seeds, points
        As for `by_seed`.
    """
    x = np.asarray(yes, float)
    share, n = float(x.mean()), float(len(x))
    if seeds is not None and (m := len(np.unique(seeds))) < n:
        n = _independent(x, share * (1 - share), seeds, points) if 0 < share < 1 else m
    k = share * n
    low = stats.beta.ppf(MISS / 2, k, n - k + 1) if k > 0 else 0.0
    return [float(low), float(stats.beta.isf(MISS / 2, k + 1, n - k)) if k < n else 1.0]


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
    each = np.bincount(_labels(seeds, None, 0)[0], weights=np.asarray(counts, float))
    total = float(each.sum())
    storm = max(1.0, each.var(ddof=1) / each.mean()) if len(each) > 1 and total else 1.0
    k, miss = total / storm, MISS / 2 if total else MISS
    low = stats.gamma.ppf(miss, k) if total else 0.0
    return [float(storm * end / exposure) for end in (low, stats.gamma.isf(miss, k + 1))]


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
    low, high = _t_or_zero(by_seed(2 * off * apart, seed, point))
    parts = np.array([
        [within.mean(), *_cox(within)],
        [between, *(between * freedom / stats.chi2.isf([MISS / 2, 1 - MISS / 2], freedom))],
        [np.mean(off**2), np.mean(off**2) + low, np.mean(off**2) + high],
    ])  # fmt: skip
    half = np.sqrt(np.sum((parts[:, 1:] - parts[:, :1]) ** 2, axis=0))
    total = parts[:, 0].sum()
    return [float(np.sqrt(max(0.0, total - half[0]))), float(np.sqrt(total + half[1]))]


def _t_or_zero(values: Array) -> tuple[float, float]:
    """Return the ends of the interval of a mean (n,), less that mean."""
    within = t_interval(values) or [0.0, 0.0]
    return within[0] - float(values.mean()), within[1] - float(values.mean())


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


def _cox(values: Array) -> tuple[float, float]:
    """Return the interval of the mean of lognormal values (n,), which holds their mean."""
    centre = float(values.mean())
    if _constant(values) or centre == 0:
        return centre, centre
    if values.min() < FLOOR * centre:  # some run does not scatter at all: no lognormal values
        low, high = mean_interval(values) or (centre, centre)
        return max(0.0, low), high
    logs = np.log(values)
    n, v = len(logs), logs.var(ddof=1)
    half = _t(n) * np.sqrt(v / n + v**2 / (2 * (n - 1)))
    low, high = np.exp(logs.mean() + v / 2 + half * np.array([-1, 1]))
    return min(centre, float(low)), max(centre, float(high))


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


def _enough(values: Array) -> bool:
    return len(values) >= LEAST and bool(np.isfinite(values).all())


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
    if not d.size:
        return 0, 0.0, 1.0
    mean = float(d.mean())
    if np.ptp(d) <= 1e-12:  # equal but for rounding, or one pair alone
        return d.size, mean, float(d.size < 2 or abs(mean) <= 1e-12)
    return d.size, mean, float(stats.ttest_1samp(d, 0.0).pvalue)
