"""Whether runs on seeds that nobody knew are worse than those that were reported: three tests.

An estimator that was tuned on the reported seeds, or that knows them, is better there than
elsewhere. A seed is one draw: its value is the mean over scenarios. The lags and the excess errors
of the two sets are compared by Welch's t test on logarithms, the lost runs by Fisher's exact test,
each one-sided at a third of the level (Bonferroni).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import fisher_exact, t, ttest_ind, ttest_rel

from flexaxis.experiments.scoring.intervals import FLOOR

Array = NDArray[np.float64]
Runs = Mapping[tuple[str, int], Sequence[Mapping[str, Any]]]
"""Rows of a case, by scenario and seed."""

LEVEL = 0.01  # chance that an honest entry is accused by any of the tests of one set
POWER = 0.9
LEAST_RATIO = 1.1
"""A difference below this is no advantage anyone would cheat for; scores are printed to 2 digits"""


@dataclass(frozen=True)
class Agreement:
    """What one test says.

    Attributes
    ----------
    score : str
    ratio : float or None
        Unknown seeds over reported ones.
    p : float
        One-sided.
    level : float
    detects : float or None
        Ratio that this number of seeds would find with a chance of `POWER`.
    holds : bool
        Whether no difference was found.
    """

    score: str
    ratio: float | None
    p: float
    level: float
    detects: float | None
    holds: bool

    def in_words(self) -> str:
        """Return it as a sentence."""
        if self.ratio is None:
            return f"{self.score}: p = {self.p:.2g}"
        text = f"{self.score} {self.ratio:.3g} × that of reported seeds (p = {self.p:.2g}"
        if self.detects is not None:
            text += f"; {self.detects:.2g} × would be found with {POWER:.0%} chance"
        return text + ")"


def agreements(reported: Runs, hidden: Runs) -> list[Agreement]:
    """Return what the tests say of two sets of runs on the same scenarios."""
    level = LEVEL / 3
    found = [_means(score, reported, hidden, level) for score in ("lag", "excess")]
    return [*(each for each in found if each), _lost(reported, hidden, level)]


def _means(score: str, reported: Runs, hidden: Runs, level: float) -> Agreement | None:
    one, other = (_by_seed(score, runs) for runs in (reported, hidden))
    if min(len(one), len(other)) < 2:
        return None
    gap = float(other.mean() - one.mean())
    p = _p(ttest_ind(other, one, equal_var=False, alternative="greater").pvalue, gap)
    parts = [each.var(ddof=1) / len(each) for each in (one, other)]
    spread = math.sqrt(sum(parts))
    sizes = (len(one) - 1, len(other) - 1)  # Welch and Satterthwaite's degrees of freedom
    freedom = sum(parts) ** 2 / max(
        sum(p**2 / n for p, n in zip(parts, sizes, strict=True)), 1e-300
    )
    detects = math.exp((t.isf(level, freedom) + t.isf(1 - POWER, freedom)) * spread)
    ratio = math.exp(gap)
    return Agreement(score, ratio, p, level, detects, not (p < level and ratio > LEAST_RATIO))


def moved(usual: Runs, earlier: Runs) -> list[Agreement]:
    """Return what is found where faults come earlier than in the catalogue, seed by seed.

    Whoever waits for the time that everybody knows is late there; the runs share their noise.
    """
    found = []
    for score in ("lag", "excess"):
        one, other = (_by_seed(score, runs) for runs in (usual, earlier))
        if len(one) == len(other) >= 2:
            gap = other - one
            p = _p(ttest_rel(other, one, alternative="greater").pvalue, float(gap.mean()))
            ratio = math.exp(float(gap.mean()))
            half = (t.isf(LEVEL / 2, len(gap) - 1) + t.isf(1 - POWER, len(gap) - 1)) * math.sqrt(
                gap.var(ddof=1) / len(gap)
            )
            wrong = p < LEVEL / 2 and ratio > MOVED_RATIO
            found.append(
                Agreement(score, ratio, p, LEVEL / 2, max(MOVED_RATIO, math.exp(half)), not wrong)
            )
    return found


MOVED_RATIO = 1.5
"""Another place in the motion changes a lag a little, for everyone."""


def _by_seed(score: str, runs: Runs) -> Array:
    """Return the mean over scenarios of ln of a score, seed by seed."""
    found: dict[int, list[float]] = {}
    for (_, seed), rows in runs.items():
        row = next((row for row in rows if row["changed"]), rows[0])
        if row[score] is not None:
            found.setdefault(seed, []).append(math.log(max(FLOOR, float(row[score]))))
    most = max(map(len, found.values()), default=0)
    return np.array([np.mean(v) for _, v in sorted(found.items()) if len(v) == most])


def _lost(reported: Runs, hidden: Runs, level: float) -> Agreement:
    counts = []
    for runs in (hidden, reported):
        lost = sum(bool(rows[0]["diverged"]) for rows in runs.values())
        counts.append([lost, len(runs) - lost])
    p = float(fisher_exact(counts, alternative="greater").pvalue)
    words = f"lost {counts[0][0]} of {len(hidden)}, of reported ones {counts[1][0]} of "
    return Agreement(f"{words}{len(reported)}", None, p, level, None, p >= level)


def _p(value: float, gap: float) -> float:
    """Return a p-value; where nothing scatters, 0 or 1 by the sign."""
    return float(value) if math.isfinite(value) else 0.0 if gap > 0 else 1.0
