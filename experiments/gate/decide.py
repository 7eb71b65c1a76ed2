"""
From log-ratios and counts of lost runs to words, for many comparisons at once.

The gate judges one comparison, its self-test thousands; both come through here. Axes are
comparison, score, seed. A lost run has no score, or a meaningless one; an average over the others
would praise an estimator for losing the hard ones: so they are counted, over all scenarios.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import comb

from flexaxis.experiments.comparison import statistics
from flexaxis.experiments.scoring.score_table import SCORES

Array = NDArray[np.float64]

WORSE, BETTER, SLIGHT, SAME, UNDECIDED = "worse", "better", "slight", "same", "undecided"

SILENT = "not more"
"""Of lost runs and of a bias, which have a say only where they decide: no more than chance does."""

ALPHA = 0.01
"""Chance of any false "worse" or "better" in a comparison, at most."""

SHARES = {"scores": 0.5, "guards": 0.1, "diverged": 0.2, "never_settled": 0.2}
"""How the families share alpha: all scores together, what has a say only where it is worse (there
is as much of it as of scores, which would lose power to it), and each way to lose a run."""

LOST_WORSE = 0.75
"""Part of a lost-run test's share that goes to "worse"; the rest goes to "better".

At alpha .01 that is .0015, so that ten runs lost and none regained (p = 2⁻¹⁰ = .00098) are enough.
"""

UNSEEN = 0.5
"""How far on the other side (log-ratio; 1.65 times) runs may lie that did not show."""

FAILED = 0.2
"""A pair this far on the other side (log-ratio; 22 % slower or noisier) is a failure …"""

SCATTER = 4 * 1.4826
"""… if it is also so many median deviations (four standard deviations) off the median: where
scores always scatter so much, a far pair is none."""


@dataclass(frozen=True, eq=False)
class Family:
    """The scores (S,) that are judged together.

    Attributes
    ----------
    scenarios, metrics : ndarray (S,) of str
    margins : ndarray (S,)
        Changes of the logarithm, or of the share, that do not matter.
    """

    scenarios: NDArray[np.str_]
    metrics: NDArray[np.str_]
    margins: Array

    @property
    def guards(self) -> NDArray[np.bool_]:
        """Which of the scores (S,) have a say only where they are worse."""
        return np.array([m in SCORES and SCORES[m].guard for m in self.metrics], bool)

    @staticmethod
    def of(scenarios: Sequence[str], metrics: Sequence[str], margins: Sequence[float]) -> Family:
        """Return the family of scores with their margins as shares (.02 is 2 %)."""
        return Family(np.array(scenarios), np.array(metrics), np.log1p(margins))


@dataclass(frozen=True, eq=False)
class Decision:
    """What was found of each score; all arrays are (C, S).

    Attributes
    ----------
    n, mean, sd, p : ndarray
        Of the log-ratios.
    level, low, high : ndarray
        Interval of the mean, and the chance with which it may miss.
    support, choices : ndarray
        Runs that speak for the direction of the score: those of all scores of its metric that go
        the same way, each run once; 0 where it goes no way. And the number of ways to choose that
        many scenarios, for those that agree are chosen after the event.
    few, far : ndarray of bool
        Clear, but said by too few runs; clear, but a pair lies far on the other side.
    words : ndarray of str
    """

    n: NDArray[np.int64]
    mean: Array
    sd: Array
    p: Array
    level: Array
    low: Array
    high: Array
    support: NDArray[np.int64]
    choices: Array
    few: NDArray[np.bool_]
    far: NDArray[np.bool_]
    words: NDArray[np.str_]


def decide(ratios: Array, family: Family, *, alpha: float = ALPHA) -> Decision:
    """Judge the scores of each comparison.

    Parameters
    ----------
    ratios : ndarray (C, S, n)
        log(candidate/base) of C comparisons, S scores and n seeds, of scores that may be 0 the
        difference as a share; NaN where there is no pair.
    family : Family
    alpha : float
        Of the whole comparison. The scores have their share of it; what no run has shown is
        reckoned with at alpha itself (`statistics.unseen_shift`).
    """
    n, mean, sd = statistics.summary(ratios)
    # Scores that are equal on every seed cannot differ: they are tested by nobody, and cost nobody.
    p = np.where((sd == 0) & (mean == 0), np.nan, statistics.t_p(n, mean, sd))
    level = np.empty_like(p)
    for share, mine in (("scores", ~family.guards), ("guards", family.guards)):
        level[:, mine] = statistics.holm_levels(p[:, mine], SHARES[share] * alpha)
    found = judged(n, family, alpha, mean=mean, sd=sd, p=p, level=level)
    far = _far(ratios, n, found.high < -family.margins, family)
    words = np.where(far & (found.words == BETTER), UNDECIDED, found.words)
    return replace(found, far=far, words=words)


def judged(
    n: NDArray[np.int64],
    family: Family,
    alpha: float,
    *,
    mean: Array,
    sd: Array,
    p: Array,
    level: Array,
) -> Decision:
    """Return what is said of so many runs with a mean and deviation, were none of them far."""
    half = statistics.half_width(sd, n, level)
    low, high = mean - half, mean + half
    way = np.where(low > 0, 1, np.where(high < 0, -1, 0))
    support, choices = _support(way, n, family)
    beyond = (low > family.margins) | (high < -family.margins)
    few = beyond & (np.abs(mean) <= statistics.unseen_shift(support, alpha / choices, UNSEEN))
    said = beyond & ~few
    inside = (low > -family.margins) & (high < family.margins)
    said_words = [WORSE, BETTER, SLIGHT, SAME]
    words = np.select([said & (way > 0), said, inside & (way != 0), inside], said_words, UNDECIDED)
    words = np.where(family.guards & (words != WORSE), SILENT, words)
    p = np.where(np.isnan(p), 1.0, p)
    none = np.zeros_like(few)
    return Decision(n, mean, sd, p, level, low, high, support, choices, few, none, words)


def _support(
    way: NDArray[np.int64], n: NDArray[np.int64], family: Family
) -> tuple[NDArray[np.int64], Array]:
    """Return the runs behind each score, and the ways to choose as many scenarios as agree."""
    support, choices = np.zeros_like(n), np.ones(n.shape)
    for metric in np.unique(family.metrics):
        of_metric = family.metrics == metric
        names, place = np.unique(family.scenarios[of_metric], return_inverse=True)
        for side in (-1, 1):
            runs = np.zeros((len(names), len(n)), n.dtype)  # the most of a scenario
            np.maximum.at(runs, place, np.where(way == side, n, 0)[:, of_metric].T)
            here = (way == side) & of_metric
            support = np.where(here, runs.sum(axis=0)[:, None], support)
            ways = comb(len(names), (runs > 0).sum(axis=0))
            choices = np.where(here, ways[:, None], choices)
    return support, choices


def _far(
    ratios: Array, n: NDArray[np.int64], better: NDArray[np.bool_], family: Family
) -> NDArray[np.bool_]:
    """Return which "better" is spoilt by a run far on the other side, in any score of its metric.

    Only better: who hides a failure among gains is to be stopped, and who hides a gain among
    failures is worse all the same.
    """
    far = np.zeros_like(better)
    asked = better.any(axis=1)
    if asked.any():
        failed = np.asarray(far_pairs(ratios[asked], n[asked]).any(axis=2))
        for metric in np.unique(family.metrics):
            of_metric = family.metrics == metric
            spoilt = np.asarray(failed[:, of_metric].any(axis=1))
            far[asked] |= of_metric & spoilt[:, None]
    return far & better


def far_pairs(ratios: Array, n: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which pairs (C, S, n) are far slower or noisier than base, and than the others."""
    middle = _median(ratios, n)[..., None]
    off = ratios - middle
    scatter = _median(np.abs(off), n)[..., None]
    with np.errstate(invalid="ignore"):
        return (ratios > FAILED) & (off > SCATTER * scatter)


def _median(values: Array, n: NDArray[np.int64]) -> Array:
    """Return the median over the last axis, NaN left out (n values are none): quick in bulk."""
    ordered = np.sort(values, axis=-1)  # NaN comes last
    low, high = (np.maximum(k, 0)[..., None] for k in ((n - 1) // 2, n // 2))
    high = np.minimum(high, values.shape[-1] - 1)
    middle = np.take_along_axis(ordered, low, axis=-1) + np.take_along_axis(ordered, high, axis=-1)
    return middle[..., 0] / 2


def overall(words: NDArray[np.str_], lost: NDArray[np.str_]) -> NDArray[np.str_]:
    """Return the one word of each comparison.

    Any worse, else any undecided, else any better, else any slight, else same; without a score
    there is nothing to be the same.

    Parameters
    ----------
    words : ndarray (C, S) of str
        Of the scores.
    lost : ndarray (C, L) of str
        Of the counts of lost runs; what is none of the words has no say.
    """
    both = np.concatenate([words, lost], axis=1)
    order = (WORSE, UNDECIDED, BETTER, SLIGHT)
    said = [(both == word).any(axis=1) for word in order]
    fallback = SAME if words.shape[1] else UNDECIDED
    return np.select(said, order, fallback)


MANY = 2
"""From so many runs newly lost on, of which the base lost none, a comparison is not passed …"""

CHANCE = 0.05
"""… and where the base loses runs, too, if chance would lose so many more at most this often."""


def levels(way: str, alpha: float = ALPHA) -> tuple[float, float]:
    """Return the levels of "worse" and "better" of the test of a way to lose a run.

    Examples
    --------
    >>> [round(level, 6) for level in levels("diverged")]
    [0.0015, 0.0005]
    """
    share = SHARES[way] * alpha
    return LOST_WORSE * share, (1 - LOST_WORSE) * share


def judge_lost(
    newly: ArrayLike, regained: ArrayLike, way: str, *, alpha: float = ALPHA
) -> NDArray[np.str_]:
    """Return the word for each comparison.

    Worse (better) where McNemar's exact test rejects that a run which only one side lost is as
    often the base's. Undecided where a run is newly lost and not made up for. The rest has no say.

    Parameters
    ----------
    newly, regained : int or ndarray (C,)
        Runs that only the candidate lost, and only the base.
    way : str
        One of `pairs.LOST`.
    alpha : float
        Of the whole comparison.
    """
    newly, regained = np.asarray(newly), np.asarray(regained)
    worse, better = levels(way, alpha)
    return np.select(
        [
            statistics.sign_p(newly, regained) <= worse,
            statistics.sign_p(regained, newly) <= better,
            (newly > 0) & (newly >= regained),
        ],
        [WORSE, BETTER, UNDECIDED],
        SILENT,
    )


def alarming(newly: ArrayLike, regained: ArrayLike, base: ArrayLike) -> NDArray[np.bool_]:
    """Return whether so many runs were newly lost that somebody should look, significant or not.

    Where the base never loses a run, two are enough. Where both lose runs by chance, one of them
    will often have two more than the other, and that says nothing.

    Parameters
    ----------
    newly, regained : array_like (..., W)
        Runs that only the candidate lost, and only the base, in each way to lose a run.
    base : array_like (..., W)
        All runs that the base lost.
    """
    each = [np.asarray(count) for count in (newly, regained, base)]
    new, back, all_ = (np.concatenate([n, n.sum(axis=-1, keepdims=True)], axis=-1) for n in each)
    many = (new >= MANY) & ((all_ == 0) | (statistics.sign_p(new, back) <= CHANCE))
    return np.asarray(many.any(axis=-1))


def runs_needed(newly: int, regained: int, runs: int, level: float) -> int | None:
    """Return how many runs would decide, if the shares of lost runs stay what they are now."""

    def decided(n: int) -> bool:
        more, less = round(newly * n / runs), round(regained * n / runs)
        return bool(statistics.sign_p(more, less) <= level)

    return statistics.first_above(decided, runs)
