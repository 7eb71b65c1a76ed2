"""Lost runs: what can be said of runs that the candidate lost and the base did not.

A lost run has no score, or a meaningless one; an average over the others would praise an estimator
for losing the hard ones. So runs are counted, over all scenarios together.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.comparison import statistics
from flexaxis.experiments.gate.decide import (
    ALPHA,
    BETTER,
    LOST_WORSE,
    SHARES,
    SILENT,
    UNDECIDED,
    WORSE,
)

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
