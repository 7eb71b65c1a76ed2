"""Runs that no entrant could know, drawn by whoever verifies, and whether they are worse.

Each case has a seed, a time of the change, noise and motion of its own: what one case might tell
the next is of no use to it. An estimator that was tuned on the reported seeds, or that knows them,
is better there than elsewhere. Lag and excess error of the two are compared by Welch's t test on
logarithms, the lost runs by exchanging draws between the sets, each one-sided; all tests of an
entry share one level (Bonferroni).
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from itertools import chain, zip_longest
from random import Random
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import permutation_test, t, ttest_ind

from flexaxis.experiments.board.entry import REPORTING, TUNING, EntryError
from flexaxis.experiments.scoring.intervals import FLOOR
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]
Runs = Mapping[tuple[str, int], Sequence[Mapping[str, Any]]]
"""Rows of a case, by scenario with its setting, and number of the draw."""

FIRST, LAST = 10_000, 2**63 - 1  # what a signed integer of 64 bits holds: nobody can try all
APART = 3.0  # s that what changes comes earlier or later than in the catalogue, at most
SOONEST = 1.0  # s after the start, for the first change

LEVEL = 0.01  # chance that an honest entry is accused by any of its tests
POWER = 0.9
LEAST_RATIO = 1.1
"""A difference below this is no advantage anyone would cheat for; scores are printed to 2 digits"""
FORGED = 0.1  # share of forged cases of which the chance to see one is told
EXCHANGES = 99_999  # of draws between two sets, where there are more ways than that


@dataclass(frozen=True)
class Draw:
    """What is drawn.

    Attributes
    ----------
    token : str
        What it is drawn from, to be printed afterwards: with it everything is repeated.
    """

    token: str

    @classmethod
    def new(cls, given: str | None = None) -> Draw:
        """Return a new one of the system's randomness, or one that was printed.

        Raises
        ------
        EntryError
            If what is given is no such text.
        """
        if given is not None and not (given.isalnum() and 8 <= len(given) <= 64):
            raise EntryError(f"--seed-from {given!r}: give what was printed, such as 3f2a9c51d07b")
        return cls(given or os.urandom(16).hex())

    def random(self, purpose: str) -> Random:
        """Return random numbers for some purpose."""
        return Random(f"{self.token} {purpose}")

    def case(self, scenario: Scenario, text: str, number: int) -> tuple[Scenario, int]:
        """Return a scenario with its changes at another time, and a seed, for one case alone.

        With noise and motion of the scenario itself, the first sample that differs would give the
        time away.

        Parameters
        ----------
        scenario : Scenario
        text : str
            Setting of the estimator.
        number : int
            Of the draw.
        """
        assert max(TUNING[-1], REPORTING[-1]) < FIRST
        own = f"{scenario.name} {text} {number}"
        random = self.random(own)
        changes: dict[str, Any] = {
            "streams": sha256(f"{self.token} {scenario.key} {own}".encode()).hexdigest()
        }
        if scenario.onset_spread is not None:  # another seed is another time, as in reported runs
            return scenario.override(changes), random.randrange(FIRST, LAST)
        tables = {key: getattr(scenario, key) or () for key in ("fault", "nuisance")}
        times = [table.at for every in tables.values() for table in every]
        by = round(random.uniform(max(-APART, SOONEST - min(times)), APART), 2) if times else 0.0
        for key, every in tables.items():
            for i, table in enumerate(every):
                for name in ("at", "until"):
                    if getattr(table, name, None) is not None:
                        changes[f"{key}[{i}].{name}"] = getattr(table, name) + by
        return scenario.override(changes), random.randrange(FIRST, LAST)


def sample(
    ranked: Sequence[Any], seeds: Sequence[int], number: int, random: Random
) -> tuple[list[tuple[Any, int]], str]:
    """Return the cases to be run again, and in words what they would see.

    In turn a case is drawn of each setting that carries a rank, so that none is drawn twice before
    all are drawn once.
    """
    strata = [[(each, seed) for seed in random.sample(seeds, len(seeds))] for each in ranked]
    random.shuffle(strata)
    every = [case for case in chain(*zip_longest(*strata)) if case is not None]
    chosen, forged = every[:number], max(1, round(FORGED * len(every)))
    seen = 1 - math.comb(len(every) - forged, len(chosen)) / math.comb(len(every), len(chosen))
    return chosen, (
        f"{len(chosen)} of {len(every)} that carry the rank, at {len(strata)} settings: were a "
        f"tenth forged, one would be seen with a chance of {100 * seen:.0f} %"
    )


@dataclass(frozen=True)
class Pair:
    """Two sets of runs of the same settings: a name of them, reported runs, and drawn ones."""

    group: str
    usual: Runs
    drawn: Runs


@dataclass(frozen=True)
class Agreement:
    """What one test says.

    Attributes
    ----------
    score : str
    ratio : float or None
        Drawn runs over reported ones.
    p : float
        One-sided, that the ratio is no more than is allowed.
    level : float
    spread : float or None
        Standard deviation of ln ratio.
    freedom : float or None
        Degrees of freedom of the test.
    """

    score: str
    ratio: float | None
    p: float
    level: float = LEVEL
    spread: float | None = None
    freedom: float | None = None

    @property
    def holds(self) -> bool:
        """Whether no difference was found."""
        return self.p >= self.level

    @property
    def detects(self) -> float | None:
        """Ratio that this number of draws finds with a chance of `POWER`."""
        if self.spread is None or self.freedom is None:
            return None
        ends = t.isf(self.level, self.freedom) + t.isf(1 - POWER, self.freedom)
        return LEAST_RATIO * math.exp(min(700.0, float(ends) * self.spread))

    def in_words(self) -> str:
        """Return it as a sentence."""
        if self.ratio is None:
            return f"{self.score}: p = {self.p:.2g}"
        text = f"{self.score} {self.ratio:.3g} × that of reported seeds"
        text += f" (more than {LEAST_RATIO:g} ×: p = {self.p:.2g}"
        if self.detects is not None:
            text += f"; {self.detects:.2g} × would be found with {POWER:.0%} chance"
        return text + ")"


def agreements(pairs: Sequence[Pair]) -> list[Agreement]:
    """Return what the tests say of all that is compared of an entry, at one level together."""
    found = [_means(pair, score) for pair in pairs for score in ("lag", "excess")]
    every = [*(each for each in found if each), _lost(pairs)]
    return [replace(each, level=LEVEL / len(every)) for each in every]


def _means(pair: Pair, score: str) -> Agreement | None:
    usual, drawn = (_by_draw(score, runs) for runs in (pair.usual, pair.drawn))
    if min(len(usual), len(drawn)) < 2:
        return None
    gap, allowed = float(drawn.mean() - usual.mean()), math.log(LEAST_RATIO)
    test = ttest_ind(drawn - allowed, usual, equal_var=False, alternative="greater")
    # where nothing scatters, 0 or 1 by the sign
    p = float(test.pvalue) if math.isfinite(test.pvalue) else float(gap <= allowed)
    spread = math.sqrt(sum(each.var(ddof=1) / len(each) for each in (drawn, usual)))
    freedom = float(np.nan_to_num(test.df, nan=1.0))
    what = f"{pair.group}: {score}"
    return Agreement(what, math.exp(gap), p, spread=spread, freedom=max(1.0, freedom))


def _by_draw(score: str, runs: Runs) -> Array:
    """Return the mean over scenarios and changed parameters of ln of a score, draw by draw."""
    found: dict[int, list[float]] = {}
    for (_, number), rows in runs.items():
        for row in [row for row in rows if row["changed"]] or rows[:1]:
            if row[score] is not None:
                found.setdefault(number, []).append(math.log(max(FLOOR, float(row[score]))))
    most = max(map(len, found.values()), default=0)
    return np.array([np.mean(v) for _, v in sorted(found.items()) if len(v) == most])


def _lost(pairs: Sequence[Pair]) -> Agreement:
    """Compare lost runs; those of a seed may be lost together, so that seeds are exchanged."""
    drawn = _lost_by_draw([pair.drawn for pair in pairs])
    usual = _lost_by_draw([pair.usual for pair in pairs])
    words = f"lost {np.sum(drawn):.0f} runs in {len(drawn)} draws, of reported ones "
    words += f"{np.sum(usual):.0f} on {len(usual)} seeds"
    if not np.any(drawn):
        return Agreement(words, None, 1.0)
    found = permutation_test(
        (drawn, usual), lambda a, b, axis: a.mean(axis) - b.mean(axis), vectorized=True,
        alternative="greater", n_resamples=EXCHANGES, rng=np.random.default_rng(0),
    )  # fmt: skip
    return Agreement(words, None, float(found.pvalue))


def _lost_by_draw(sets: Sequence[Runs]) -> Array:
    found: dict[int, float] = {}
    for runs in sets:
        for (_, number), rows in runs.items():
            found[number] = found.get(number, 0.0) + bool(rows[0]["diverged"])
    return np.array(list(found.values()))
