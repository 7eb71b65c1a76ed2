"""Intervals over seeds, and tests of paired runs.

All are at 95 % and None below five seeds: of fewer nobody can say how far they spread. A seed is
one draw: runs of one seed at several points of a sweep share their noise, and what is pooled over
them is first put together seed by seed (`by_seed`). `tests/experiments/test_intervals.py` measures
the coverage.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats
from scipy.special import betaincinv, chdtri, stdtrit
from scipy.stats import binom

Array = NDArray[np.float64]
Interval = list[float]

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
    n, centre, spread = len(x), x.mean(), x.std(ddof=1)
    if _constant(x):
        return [float(centre)] * 2
    g = float(np.mean((x - centre) ** 3) / x.std() ** 3)
    return [float(centre - spread * _hall(sign * _t(n), g, n)) for sign in (1, -1)]


def _hall(t: float, skewness: float, n: int) -> float:
    """Return (mean − μ)/s at which Hall's transformed t statistic has the value t."""
    y = t / math.sqrt(n)
    if abs(skewness) < 1e-6:  # the limit of what follows
        return y
    root = np.cbrt(1 + skewness * (y - skewness / (6 * n)))
    return float(3 / skewness * (root - 1))


def log_interval(values: ArrayLike) -> Interval | None:
    """Return the interval of the geometric mean of positive values: Student's t on logarithms."""
    within = t_interval(np.log(np.maximum(np.asarray(values, float), FLOOR)))
    return within and [math.exp(end) for end in within]


def t_interval(values: ArrayLike) -> Interval | None:
    """Return the interval of the mean of values (n,) by Student's t."""
    x = np.asarray(values, float)
    if not _enough(x):
        return None
    half = 0.0 if _constant(x) else _t(len(x)) * float(x.std(ddof=1)) / math.sqrt(len(x))
    return [float(x.mean()) - half, float(x.mean()) + half]


def by_seed(values: ArrayLike, seeds: ArrayLike, points: ArrayLike) -> Array:
    """Return what each of m seeds says of the mean of values over fixed points: (m,).

    Their mean is that of the values, and their scatter that of it: of a seed with the deviations
    d_i = x_i − x̄ of its point, x̄ + m/n Σ d_i, the variance of clusters (W. G. Cochran, *Sampling
    Techniques*, 3rd ed., chapters 5 and 9). The levels of points are no draws. With the same seeds
    at all points it is the mean over points, seed by seed. Where a point has a single run, the
    points are draws themselves.

    Parameters
    ----------
    values, seeds, points : (n,) array_like
        Of the runs; points by any number that tells them apart.
    """
    x = np.asarray(values, float)
    seed, m = _numbered(seeds)
    point, runs = _fixed(points)
    if m == len(x) and len(runs) < 2:
        return x
    apart = x - (np.bincount(point, weights=x) / runs)[point]
    apart *= np.sqrt(runs / (runs - 1) * (m - 1) / m)[point]
    return np.asarray(x.mean() + m / len(x) * np.bincount(seed, weights=apart))


def _fixed(points: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the number of the point of each run, and the runs at each; all one with one run."""
    point, _ = _numbered(points)
    runs = np.bincount(point)
    if runs.size and runs.min() < 2:
        return np.zeros_like(point), np.array([len(point)])
    return point, runs


def _numbered(labels: ArrayLike) -> tuple[NDArray[np.intp], int]:
    known, place = np.unique(np.asarray(labels), return_inverse=True)
    return place, len(known)


def median_interval(
    values: ArrayLike, seeds: ArrayLike | None = None, points: ArrayLike | None = None
) -> list[float | None] | None:
    """Return the interval of the median by order statistics; an end at infinity is None.

    Where seeds come more than once, of as many independent values as would leave the share of
    those below the median as uncertain as it is (`_independent`).

    Parameters
    ----------
    values : (n,) array_like
    seeds, points : (n,) array_like, optional
        As for `by_seed`; without, each value is of a seed of its own.
    """
    x = np.sort(np.asarray(values, float))
    n = m = len(x)
    if seeds is not None and points is not None and _numbered(seeds)[1] < n:
        middle, each = x[[(n - 1) // 2, n // 2]], np.asarray(values, float)
        below = ((each <= middle[0]) * 1.0 - (each >= middle[1])) / 2
        m = int(_independent(below, 0.25, seeds, points))
    if m < LEAST:
        return None
    rank = int(binom.ppf(MISS / 2, m, 0.5)) * n // m
    if rank < 1:  # six values are the fewest that hold the median so surely
        return None
    return [float(v) if np.isfinite(v) else None for v in (x[rank - 1], x[n - rank])]


def _independent(values: Array, variance: float, seeds: ArrayLike, points: ArrayLike) -> float:
    """Return of how many independent values with a variance the mean would be as uncertain.

    L. Kish, *Survey Sampling*, 1965, section 8.2; as many as there are seeds at least.
    """
    n, m = len(values), _numbered(seeds)[1]
    of_mean = float(by_seed(values, seeds, points).var(ddof=1)) / m if m > 1 else 0.0
    return float(np.clip(variance / of_mean, m, n)) if of_mean > 0 else n


def share_interval(
    yes: ArrayLike, seeds: ArrayLike | None = None, points: ArrayLike | None = None
) -> Interval:
    """Return the interval of a share of runs (C. J. Clopper and E. S. Pearson, 1934).

    Where seeds come more than once, of as many independent runs as are as uncertain; a share of
    none or all tells nothing of that, and then each seed counts once.

    Parameters
    ----------
    yes : (n,) array_like of bool
    seeds, points : (n,) array_like, optional
        As for `by_seed`; without, each run is of a seed of its own.
    """
    x = np.asarray(yes, float)
    share, n = float(x.mean()), float(len(x))
    if seeds is not None and points is not None and (m := _numbered(seeds)[1]) < n:
        n = _independent(x, share * (1 - share), seeds, points) if 0 < share < 1 else m
    k = share * n
    low = float(betaincinv(k, n - k + 1, MISS / 2)) if k > 0 else 0.0
    return [low, float(betaincinv(k + 1, n - k, 1 - MISS / 2)) if k < n else 1.0]


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
    place, m = _numbered(seeds)
    each = np.bincount(place, weights=np.asarray(counts, float), minlength=m)
    total = float(each.sum())
    storm = max(1.0, float(each.var(ddof=1)) / each.mean()) if m > 1 and total else 1.0
    k, miss = total / storm, MISS / 2 if total else MISS
    low = float(chdtri(2 * k, 1 - miss)) / 2 if total else 0.0
    return [storm * end / exposure for end in (low, float(chdtri(2 * k + 2, miss)) / 2)]


def spread_interval(
    std: ArrayLike,
    bias: ArrayLike,
    seeds: ArrayLike | None = None,
    points: ArrayLike | None = None,
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
        As for `by_seed`; without, each run is of a seed of its own.
    """
    rms, mean = np.asarray(std, float), np.asarray(bias, float)
    seed, m = _numbered(np.arange(len(rms)) if seeds is None else seeds)
    point, runs = _fixed(np.zeros(len(rms)) if points is None else points)
    if not (m >= LEAST and np.isfinite(rms).all() and np.isfinite(mean).all()):
        return None
    level = (np.bincount(point, weights=mean) / runs)[point]
    within = by_seed(np.maximum(rms**2 - mean**2, 0.0), seed, point)
    apart = mean - level if not _constant(mean) else np.zeros_like(mean)
    between = float(np.mean(apart**2 * (runs / (runs - 1))[point]))
    freedom = _freedom(apart, seed, point)
    low_w, high_w = _cox(within)
    low_b, high_b = (
        between * freedom / float(chdtri(freedom, q)) for q in (MISS / 2, 1 - MISS / 2)
    )
    levels = float(np.mean((level - mean.mean()) ** 2))
    moved = by_seed(2 * (level - mean.mean()) * apart, seed, point)
    half = 0.0 if _constant(moved) else _t(m) * float(moved.std(ddof=1)) / math.sqrt(m)
    centre_w = float(within.mean())
    total = centre_w + between + levels
    low = total - math.hypot(centre_w - low_w, between - low_b, half)
    high = total + math.hypot(high_w - centre_w, high_b - between, half)
    return [math.sqrt(max(0.0, low)), math.sqrt(high)]


def _freedom(apart: Array, seed: NDArray[np.intp], point: NDArray[np.intp]) -> float:
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
    n, v = len(logs), float(logs.var(ddof=1))
    middle = float(logs.mean()) + v / 2
    half = _t(n) * math.sqrt(v / n + v**2 / (2 * (n - 1)))
    return min(centre, math.exp(middle - half)), max(centre, math.exp(middle + half))


def pseudo_values(statistic: Callable[[NDArray[np.intp]], float], n: int) -> Array:
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
    return -float(stdtrit(n - 1, MISS / 2))


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
