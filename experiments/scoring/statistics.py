"""The statistics of the gate: paired log-ratios, counts of lost runs, many tests at once.

All tests are two-sided. Nothing here knows of scenarios or scores.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit
from scipy.stats import fisher_exact

Array = NDArray[np.float64]

FLOOR = 1e-6
"""Scores below this [s or %] count as this: an estimator that never moves has a std of zero."""

MOST_SEEDS = 4000  # a number of seeds above this is no answer


@dataclass(frozen=True)
class Paired:
    """Summary of paired log-ratios: how many, their mean and their standard deviation."""

    n: int
    mean: float
    sd: float

    @property
    def p(self) -> float:
        """Two-sided p-value of Student's t test that the mean is zero; 1 for fewer than two."""
        if self.n < 2:
            return 1.0
        if self.sd == 0:
            return float(self.mean == 0)
        return 2 * float(stdtr(self.n - 1, -abs(self.mean) * math.sqrt(self.n) / self.sd))

    def interval(self, level: float) -> tuple[float, float]:
        """Return the interval that misses the true mean with probability `level`."""
        half = half_width(self.sd, self.n, level)
        return self.mean - half, self.mean + half


def paired(base: Array, candidate: Array) -> Paired:
    """Summarise log(candidate/base) over pairs (n,); scores are ≥ 0."""
    ratios = np.log(np.maximum(candidate, FLOOR) / np.maximum(base, FLOOR))
    n = len(ratios)
    mean = float(ratios.mean()) if n else 0.0
    # Equal ratios have a standard deviation of rounding errors; it is none.
    sd = float(ratios.std(ddof=1)) if n > 1 and np.ptp(ratios) > 1e-12 else 0.0
    return Paired(n, mean, sd)


def half_width(sd: float, n: int, level: float) -> float:
    """Return half the width of Student's interval for a mean of n; infinite for fewer than two."""
    if n < 2:
        return math.inf
    return -float(stdtrit(n - 1, level / 2)) * sd / math.sqrt(n)


def lost_p(base: int, candidate: int, runs: int) -> float:
    """Return the two-sided p-value of Fisher's exact test on lost runs, each of `runs`.

    McNemar's paired test can do no better than 2^(1−n), .008 for 8 of 8 runs lost, and so can
    never pass a corrected level. Fisher's reaches 1.6e-4. It takes the two columns as
    independent; runs on the same record fail together rather than in turn, which can only make
    its p-values too large.
    """
    return float(fisher_exact([[base, runs - base], [candidate, runs - candidate]])[1])


def holm_levels(p: Sequence[float], alpha: float) -> Array:
    """Return the level that Holm's step-down procedure gives to each test.

    A test with p ≤ its level is rejected, and an interval at this level leaves out zero exactly
    then. The chance of any wrong rejection is at most `alpha`, however the tests depend on each
    other.

    Parameters
    ----------
    p : sequence of float, (m,)
        p-values.
    alpha : float
        Level of the family.

    Returns
    -------
    ndarray (m,)
        alpha/m for the smallest p, alpha/(m−1) for the next, …; the tests after the first that is
        not rejected all have its level.

    Examples
    --------
    >>> holm_levels([0.2, 0.001, 0.03], 0.06).round(3).tolist()
    [0.06, 0.02, 0.03]
    """
    m = len(p)
    levels = np.empty(m)
    for rank, i in enumerate(np.argsort(p, kind="stable")):
        level = alpha / (m - rank)
        levels[i] = level
        if p[i] > level:
            rest = np.argsort(p, kind="stable")[rank:]
            levels[rest] = level
            break
    return levels


def seeds_for_ratio(found: Paired, level: float, margin: float) -> int | None:
    """Return how many seeds would decide, if mean and deviation stay what they are now.

    A mean outside ±margin needs an interval that leaves out zero; one inside needs an interval
    that lies within ±margin. None if more than 4000 or if it cannot be said.
    """
    gap = abs(found.mean) if abs(found.mean) > margin else margin - abs(found.mean)
    if found.n < 2:
        return None
    return _first(lambda n: half_width(found.sd, n, level) < gap, found.n)


def seeds_for_lost(base: int, candidate: int, runs: int, level: float) -> int | None:
    """Return how many seeds would decide, if the shares of lost runs stay what they are now."""

    def decided(n: int) -> bool:
        return lost_p(round(base * n / runs), round(candidate * n / runs), n) <= level

    return _first(decided, runs)


def _first(decided, start: int) -> int | None:  # type: ignore[no-untyped-def]
    """Return the smallest n above `start` that decides, by doubling and then halving."""
    low, high = start, start + 1
    while not decided(high):
        low, high = high, 2 * high
        if low >= MOST_SEEDS:
            return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if decided(middle) else (middle, high)
    return high if high <= MOST_SEEDS else None


def rate_interval(count: int, total: int) -> tuple[float, float]:
    """Return the exact 95 % interval of a rate (Clopper and Pearson)."""
    from scipy.stats import binomtest

    found = binomtest(count, total).proportion_ci(0.95, method="exact")
    return float(found.low), float(found.high)


def sign_p(more: int, less: int) -> float:
    """Return the one-sided p-value of more against less, each of which is as likely by chance.

    The exact test on discordant pairs (McNemar; the sign test).
    """
    from scipy.stats import binom

    return float(binom.sf(more - 1, more + less, 0.5))
