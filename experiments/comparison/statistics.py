"""The statistics of verdicts: paired log-ratios, counts of lost runs, many tests at once.

What takes arrays works on any number of comparisons at once. Nothing here knows of scenarios or
scores.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import bdtrc, stdtr, stdtrit

from flexaxis.experiments.scoring.intervals import FLOOR

Array = NDArray[np.float64]

ROUNDING = 1e-12  # log-ratios that differ by no more are equal

MOST_SEEDS = 4000  # a number of seeds above this is no answer


@dataclass(frozen=True)
class LogRatios:
    """Summary of paired log-ratios: how many, their mean and their standard deviation."""

    n: int
    mean: float
    sd: float

    @property
    def p(self) -> float:
        """Two-sided p-value of Student's t test that the mean is zero; 1 for fewer than two."""
        return float(t_p(self.n, self.mean, self.sd))


def log_ratio(base: ArrayLike, candidate: ArrayLike) -> Array:
    """Return log(candidate/base) of scores ≥ 0; NaN where either is NaN."""
    return np.asarray(np.log(np.maximum(candidate, FLOOR)) - np.log(np.maximum(base, FLOOR)))


def summary(values: Array) -> tuple[NDArray[np.int64], Array, Array]:
    """Return number, mean and standard deviation over the last axis, NaN left out.

    Returns
    -------
    n, mean, sd : ndarray (...)
        Mean 0 where there is no value, deviation 0 for fewer than two.
    """
    there = np.isfinite(values)
    n = there.sum(axis=-1)
    mean = np.where(there, values, 0.0).sum(axis=-1) / np.maximum(n, 1)
    off = np.where(there, values - mean[..., None], 0.0)
    # Equal values have a standard deviation of rounding errors; it is none.
    spread = np.abs(off).max(axis=-1, initial=0.0) > ROUNDING
    sd = np.sqrt((off**2).sum(axis=-1) / np.maximum(n - 1, 1))
    mean = np.where(spread | (np.abs(mean) > ROUNDING), mean, 0.0)
    return n, mean, np.where(spread & (n > 1), sd, 0.0)


def t_p(n: ArrayLike, mean: ArrayLike, sd: ArrayLike) -> Any:
    """Return the two-sided p of Student's t test that a mean of n is zero; 1 for fewer than two."""
    n, mean, sd = np.broadcast_arrays(*map(np.asarray, (n, mean, sd)))
    with np.errstate(divide="ignore", invalid="ignore"):
        p = 2 * stdtr(np.maximum(n - 1, 1), -np.abs(mean) * np.sqrt(n) / sd)
    return np.where(n < 2, 1.0, np.where(sd == 0, (mean == 0).astype(float), p))[()]


def half_width(sd: ArrayLike, n: ArrayLike, level: ArrayLike) -> Any:
    """Return half the width of Student's interval for a mean of n; infinite for fewer than two."""
    n, sd, level = np.broadcast_arrays(*map(np.asarray, (n, sd, level)))
    half = -stdtrit(np.maximum(n - 1, 1), level / 2) * sd / np.sqrt(np.maximum(n, 1))
    return np.where(n < 2, math.inf, half)[()]


def sign_p(more: ArrayLike, less: ArrayLike) -> Any:
    """Return the one-sided p of McNemar's exact test: the chance of at least `more` heads.

    Of runs that both sides win or lose nothing is learnt; of the others each is lost by either
    side with the same chance if neither is better. So `more` of more+less is binomial(½).

    Parameters
    ----------
    more, less : int or ndarray (...)
        Pairs that only the one side lost, and only the other.

    Examples
    --------
    >>> float(sign_p(10, 0)) == 2**-10
    True
    >>> float(sign_p(0, 3))
    1.0
    """
    more, less = np.asarray(more, np.int64), np.asarray(less, np.int64)
    # P(X > more - 1); bdtrc is not defined for "more than -1", which is certain.
    tail = bdtrc(np.maximum(more - 1.0, 0.0), np.maximum(more + less, 1), 0.5)
    return np.where(more > 0, tail, 1.0)[()]


def holm_levels(p: ArrayLike, alpha: float) -> Array:
    """Return the level that Holm's step-down procedure gives to each test.

    A test with p ≤ its level is rejected, and an interval at this level leaves out zero exactly
    then. The chance of any wrong rejection is at most `alpha`, however the tests depend on each
    other. The intervals are intervals of their own, at the level given; that all of them hold at
    once has a chance a little below 1 − alpha, for the level of a rejected test is that of the
    step at which it was rejected.

    Parameters
    ----------
    p : array_like (..., m)
        p-values; each row is a family. NaN is no member of it.
    alpha : float
        Level of the family.

    Returns
    -------
    ndarray (..., m)
        alpha/m for the smallest p, alpha/(m−1) for the next, …; the tests after the first that is
        not rejected all have its level. What is no member has alpha.

    Examples
    --------
    >>> holm_levels([0.2, 0.001, 0.03], 0.06).round(3).tolist()
    [0.06, 0.02, 0.03]
    """
    p = np.asarray(p, float)
    order = np.argsort(p, axis=-1, kind="stable")  # NaN comes last
    ordered = np.take_along_axis(p, order, axis=-1)
    members = np.isfinite(p).sum(axis=-1, keepdims=True)
    rank = np.arange(p.shape[-1])
    steps = alpha / np.maximum(members - rank, 1)
    last = p.shape[-1]
    first = np.where(ordered > steps, rank, last).min(axis=-1, initial=last, keepdims=True)
    steps = np.take_along_axis(steps, np.minimum(rank, first), axis=-1)
    levels = np.empty_like(p)
    np.put_along_axis(levels, order, np.where(rank < members, steps, alpha), axis=-1)
    return levels


def unseen_shift(n: ArrayLike, alpha: ArrayLike, far: float) -> Any:
    """Return how far runs that none of n showed can shift a mean, at level `alpha`.

    What happens in a share q of the runs is missed by all n with chance (1 − q)ⁿ, so q up to
    1 − alpha^(1/n) must be reckoned with. Lying at a distance `far` on the other side, that share
    balances a mean of far·q/(1 − q) of the runs seen.

    Examples
    --------
    >>> unseen_shift([8, 32, 128], 0.01, 0.5).round(3).tolist()
    [0.389, 0.077, 0.018]
    """
    with np.errstate(divide="ignore", over="ignore"):
        return far * np.expm1(-np.log(alpha) / np.asarray(n, float))


def first_above(decided: Callable[[int], bool], start: int) -> int | None:
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
