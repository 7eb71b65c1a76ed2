"""Intervals over seeds: what each is for, and how often it covers what it is for.

All are at 95 % and None below five values: of fewer nobody can say how far they spread. Runs are
taken as independent draws, one a seed. `tests/experiments/test_intervals.py` measures the coverage.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri, stdtrit
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
    x = np.log(np.maximum(np.asarray(values, float), FLOOR))
    if not _enough(x):
        return None
    half = 0.0 if _constant(x) else _t(len(x)) * x.std(ddof=1) / math.sqrt(len(x))
    return [math.exp(x.mean() - half), math.exp(x.mean() + half)]


def stratified_interval(points: Sequence[tuple[ArrayLike, ArrayLike]]) -> Interval | None:
    """Return the interval of the geometric mean over fixed points: their levels are no draws.

    Each point has a mean of its own, and only what scatters about it says how far the mean over
    all points might be off. Runs of one seed at several points share their noise, so that a seed
    counts as one draw (the variance of clusters; W. G. Cochran, *Sampling Techniques*, 3rd ed.,
    chapters 5 and 9). With the same seeds at all points it is `log_interval` of the mean over
    points, seed by seed.

    Parameters
    ----------
    points : sequence of (array_like (n,), array_like (n,))
        Positive values and seeds of the runs at each point, two or more at each.

    Returns
    -------
    list of float or None
        None with fewer than five seeds.
    """
    logs = [np.log(np.maximum(np.asarray(values, float), FLOOR)) for values, _ in points]
    seeds = np.concatenate([np.asarray(each) for _, each in points])
    apart = np.concatenate([x - x.mean() for x in logs])
    known, place = np.unique(seeds, return_inverse=True)
    n = len(known)
    if n < LEAST or not np.isfinite(apart).all():
        return None
    sums = np.bincount(place, weights=apart) / len(apart)
    half = _t(n) * math.sqrt(float(sums @ sums) * n / (n - 1))
    centre = float(np.concatenate(logs).mean())
    return [math.exp(centre - half), math.exp(centre + half)]


def median_interval(values: ArrayLike) -> list[float | None] | None:
    """Return the interval of the median by order statistics; an end at infinity is None."""
    x = np.sort(np.asarray(values, float))
    rank = int(binom.ppf(MISS / 2, len(x), 0.5)) if len(x) >= LEAST else 0
    if len(x) < LEAST or rank < 1:  # six values are the fewest that hold the median so surely
        return None
    return [float(v) if np.isfinite(v) else None for v in (x[rank - 1], x[len(x) - rank])]


def spread_interval(std: ArrayLike, bias: ArrayLike) -> Interval | None:
    """Return the interval of the standard deviation over time and seeds, as `pools.spread` has it.

    The variance is that within the runs plus that of their means. The first has the interval of
    the mean of lognormal values (Cox's), the second that of a normal variance (χ², n−1 degrees of
    freedom), and the sum theirs, put together by recovery of variances (G. Y. Zou and
    A. Donner, Stat. Methods Med. Res. 17, 2008, 1–10).

    Parameters
    ----------
    std, bias : (n,) array_like
        Root mean square about zero, and mean, of each run.
    """
    rms, mean = np.asarray(std, float), np.asarray(bias, float)
    if not (_enough(rms) and np.isfinite(mean).all()):
        return None
    n = len(rms)
    within = np.maximum(rms**2 - mean**2, 0.0)
    between = float(mean.var(ddof=1)) if not _constant(mean) else 0.0
    low_w, high_w = _cox(within)
    low_b, high_b = (between * (n - 1) / float(chdtri(n - 1, q)) for q in (MISS / 2, 1 - MISS / 2))
    centre_w = float(within.mean())
    total = centre_w + between
    low = total - math.hypot(centre_w - low_w, between - low_b)
    high = total + math.hypot(high_w - centre_w, high_b - between)
    return [math.sqrt(max(0.0, low)), math.sqrt(high)]


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
