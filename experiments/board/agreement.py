"""Whether runs that nobody could know are worse than those that were reported: the tests.

An estimator that was tuned on the reported seeds, or that knows them, is better there than
elsewhere. A seed is one draw: its value is the mean over scenarios. The lags and the excess errors
of two sets are compared by Welch's t test on logarithms, the lost runs by exchanging seeds between
the sets, each one-sided; all tests of an entry share one level (Bonferroni).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import permutation_test, t, ttest_ind

from flexaxis.experiments.scoring.intervals import FLOOR

Array = NDArray[np.float64]
Runs = Mapping[tuple[str, int], Sequence[Mapping[str, Any]]]
"""Rows of a case, by scenario with its setting, and seed."""

LEVEL = 0.01  # chance that an honest entry is accused by any of its tests
POWER = 0.9
LEAST_RATIO = 1.1
"""A difference below this is no advantage anyone would cheat for; scores are printed to 2 digits"""
MOVED_RATIO = 1.5
"""Another place in the motion changes a lag a little, for everyone."""
EXCHANGES = 99_999  # of seeds between two sets, where there are more ways than that


@dataclass(frozen=True)
class Pair:
    """Two sets of runs of the same settings.

    Attributes
    ----------
    name, group : str
        What is looked at, and where.
    usual, other : Runs
        Reported, and made by whoever verifies.
    least : float
        Ratio up to which the second set may be worse.
    """

    name: str
    group: str
    usual: Runs
    other: Runs
    least: float = LEAST_RATIO


@dataclass(frozen=True)
class Agreement:
    """What one test says.

    Attributes
    ----------
    name, score : str
    ratio : float or None
        The second set over the first.
    p : float
        One-sided, that the ratio is no more than is allowed.
    level : float
    spread : float or None
        Standard deviation of ln ratio.
    freedom : float or None
        Degrees of freedom of the test.
    least : float
        Ratio that is allowed.
    """

    name: str
    score: str
    ratio: float | None
    p: float
    level: float = LEVEL
    spread: float | None = None
    freedom: float | None = None
    least: float = LEAST_RATIO

    @property
    def holds(self) -> bool:
        """Whether no difference was found."""
        return self.p >= self.level

    @property
    def detects(self) -> float | None:
        """Ratio that this number of seeds finds with a chance of `POWER`."""
        if self.spread is None or self.freedom is None:
            return None
        ends = t.isf(self.level, self.freedom) + t.isf(1 - POWER, self.freedom)
        return self.least * math.exp(min(700.0, float(ends) * self.spread))

    def in_words(self) -> str:
        """Return it as a sentence."""
        if self.ratio is None:
            return f"{self.score}: p = {self.p:.2g}"
        text = f"{self.score} {self.ratio:.3g} × that of reported seeds"
        text += f" (more than {self.least:g} ×: p = {self.p:.2g}"
        if self.detects is not None:
            text += f"; {self.detects:.2g} × would be found with {POWER:.0%} chance"
        return text + ")"


def agreements(pairs: Sequence[Pair]) -> list[Agreement]:
    """Return what the tests say of all that is compared of an entry, at one level together."""
    found = [_means(pair, score) for pair in pairs for score in ("lag", "excess")]
    every = [each for each in found if each]
    every += [_lost(name, pairs) for name in dict.fromkeys(pair.name for pair in pairs)]
    return [replace(each, level=LEVEL / len(every)) for each in every]


def _means(pair: Pair, score: str) -> Agreement | None:
    one, other = (_by_seed(score, runs) for runs in (pair.usual, pair.other))
    if min(len(one), len(other)) < 2:
        return None
    gap, allowed = float(other.mean() - one.mean()), math.log(pair.least)
    test = ttest_ind(other - allowed, one, equal_var=False, alternative="greater")
    parts = [each.var(ddof=1) / len(each) for each in (one, other)]
    sizes = (len(one) - 1, len(other) - 1)  # Welch and Satterthwaite's degrees of freedom
    below = max(sum(p**2 / n for p, n in zip(parts, sizes, strict=True)), 1e-300)
    return Agreement(
        pair.name, f"{pair.group}: {score}", math.exp(gap), _p(test.pvalue, gap - allowed),
        spread=math.sqrt(sum(parts)), freedom=max(1.0, sum(parts) ** 2 / below), least=pair.least,
    )  # fmt: skip


def _by_seed(score: str, runs: Runs) -> Array:
    """Return the mean over scenarios and changed parameters of ln of a score, seed by seed."""
    found: dict[int, list[float]] = {}
    for (_, seed), rows in runs.items():
        for row in [row for row in rows if row["changed"]] or rows[:1]:
            if row[score] is not None:
                found.setdefault(seed, []).append(math.log(max(FLOOR, float(row[score]))))
    most = max(map(len, found.values()), default=0)
    return np.array([np.mean(v) for _, v in sorted(found.items()) if len(v) == most])


def _lost(name: str, pairs: Sequence[Pair]) -> Agreement:
    """Compare lost runs; those of a seed may be lost together, so that seeds are exchanged."""
    mine = [pair for pair in pairs if pair.name == name]
    other, usual = (
        _lost_by_seed([getattr(pair, side) for pair in mine]) for side in ("other", "usual")
    )
    words = f"lost {np.sum(other):.0f} runs on {len(other)} seeds, of reported ones "
    words += f"{np.sum(usual):.0f} on {len(usual)}"
    if not np.any(other):
        return Agreement(name, words, None, 1.0)
    found = permutation_test(
        (other, usual), lambda a, b, axis: a.mean(axis) - b.mean(axis), vectorized=True,
        alternative="greater", n_resamples=EXCHANGES, rng=np.random.default_rng(0),
    )  # fmt: skip
    return Agreement(name, words, None, float(found.pvalue))


def _lost_by_seed(sets: Sequence[Runs]) -> Array:
    found: dict[int, float] = {}
    for runs in sets:
        for (_, seed), rows in runs.items():
            found[seed] = found.get(seed, 0.0) + bool(rows[0]["diverged"])
    return np.array(list(found.values()))


def _p(value: float, gap: float) -> float:
    """Return a p-value; where nothing scatters, 0 or 1 by the sign."""
    return float(value) if math.isfinite(value) else 0.0 if gap > 0 else 1.0
