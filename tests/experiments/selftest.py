"""The gate tested on itself: how often it raises a false alarm, and what it finds.

A pool of seeds is run once: each base, the base again with an independent noise on the same
excitation and faults, and a planted change. Comparisons are then drawn from it, each of some seeds
without replacement. In a comparison of a base with itself the two noises of a run change sides by
chance, so that neither can be better. Rare failures are made, not run: their mean must be known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np

from flexaxis.experiments.comparison.ranking import REFERENCE
from flexaxis.experiments.gate.gate import look_counts, rows_of
from flexaxis.experiments.gate.pairs import pair
from flexaxis.experiments.running.bench import Bench
from flexaxis.experiments.running.engine import Means
from flexaxis.experiments.scoring.intervals import share_interval
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario
from tests.experiments.selftest_resampling import Pool, judged
from tests.experiments.selftest_trials import (
    NONE,
    SURE,
    Promise,
    Trial,
    equal_noise,
    stored,
    trials,
)

BASES = ("rpem-forgetting", "imm")

PLANTED = "rpem-forgetting[forgetting=0.99525]"
"""About 5 % more lag than the first of the bases."""

LOOKS = tuple(
    tuple(look_counts(*counts))
    for counts in ((8, 8), (16, 16), (32, 32), (64, 64), (8, 64), (32, 128))
)
"""Seeds at each look of the comparisons drawn."""

POOL = range(1000, 1256)
BATCH = 500  # comparisons judged at once: some 10 MB


@dataclass(frozen=True)
class Rate:
    """How often the gate said something.

    Attributes
    ----------
    what : str
        In which comparisons it said what.
    looks : tuple of int
        Seeds at each look.
    count, comparisons : int
    promise : Promise
    """

    what: str
    looks: tuple[int, ...]
    count: int
    comparisons: int
    promise: Promise

    @property
    def rate(self) -> float:
        """Share of the comparisons."""
        return self.count / self.comparisons

    @property
    def interval(self) -> list[float]:
        """Exact 95 % interval of the rate."""
        return share_interval(np.arange(self.comparisons) < self.count)

    @property
    def kept(self) -> bool:
        """Whether what is promised holds."""
        promise = self.promise
        return promise.least <= self.rate <= promise.most and self.interval[1] <= promise.upper

    def as_dict(self) -> dict[str, Any]:
        """Return what goes into the JSON."""
        return {
            "what": self.what,
            "looks": list(self.looks),
            "count": self.count,
            "comparisons": self.comparisons,
            "rate": self.rate,
            "interval": self.interval,
            "promise": str(self.promise),
            "kept": self.kept,
        }


def self_test(
    scenarios: Sequence[Scenario],
    margins: Mapping[str, float],
    *,
    bases: Sequence[str] = BASES,
    planted: str | None = PLANTED,
    seeds: Sequence[int] = POOL,
    comparisons: int = 4000,
    means: Means | None = None,
    advance: Callable[[float], None] | None = None,
) -> list[Rate]:
    """Return how often the gate raises a false alarm, and how often it finds what is there.

    Parameters
    ----------
    scenarios : sequence of Scenario
    margins : mapping of metric to float
    bases : sequence of str
        Each is compared with itself.
    planted : str, optional
        Compared with the first base; worse, and should be called so.
    seeds : sequence of int
        The pool. A comparison has at most half of it.
    comparisons : int
        Drawn for each rate.
    means : Means, optional
        With what the pool is run; its `advance` is called with the cases.
    advance : callable, optional
        Called with what is done after that, as in `work`.

    Raises
    ------
    FlexaxisError
        If the pool is too small for any comparison.
    """
    looks = [look for look in LOOKS if 2 * look[-1] <= len(seeds)]
    if not looks:
        raise FlexaxisError(
            f"--seeds: a pool of {len(seeds)} seeds is too small for the self-test: give at least "
            f"{2 * LOOKS[0][-1]}, better {len(POOL)}"
        )
    names = (*bases, *(() if planted is None else (planted,)))
    with Bench(scenarios, means=means) as bench, Bench(scenarios, means=means, repeat=1) as again:
        runs, repeated = bench.runs(scenarios, names, seeds), again.runs(scenarios, bases, seeds)
        first = {name: rows_of(runs, name) for name in names}
        once = list(stored(first[bases[0]], margins))
        if bases[0] == REFERENCE:
            once += equal_noise(scenarios, margins, seeds[: LOOKS[2][0]], bench)
    same = {
        name: Pool.of(pair(first[name], rows_of(repeated, name), margins), margins)
        for name in bases
    }
    changed = None
    if planted is not None:
        changed = Pool.of(pair(first[bases[0]], first[planted], margins), margins)
    tried = list(trials(same, changed))
    share = _JUDGING * _cases(len(scenarios), len(bases), planted is not None, len(seeds))
    rates = []
    for trial in tried:
        for look in looks:
            rates.append(_rate(trial, look, comparisons, len(scenarios)))
            if advance:
                advance(share / (len(tried) * len(looks)))
    return rates + [Rate(what, looks[-1], int(right), 1, SURE) for what, right in once]


_JUDGING = 0.15  # what judging takes of the time, over what running the pool takes


def _cases(scenarios: int, bases: int, planted: bool, seeds: int) -> int:
    return scenarios * seeds * (2 * bases + planted)


def work(scenarios: int, bases: int, planted: bool, seeds: int) -> float:
    """Return how much there is to do, in the unit of `advance`: cases, and as good as cases."""
    return (1 + _JUDGING) * _cases(scenarios, bases, planted, seeds)


def _rate(trial: Trial, looks: tuple[int, ...], comparisons: int, drawn_from: int = 1) -> Rate:
    """Return how often what a trial counts is so, drawn from so many scenarios."""
    random = np.random.default_rng(crc32(f"{trial.what} {looks}".encode()))
    count, done = 0, 0
    while done < comparisons:
        batch = min(BATCH, comparisons - done)
        count += int(trial.count(judged(trial.draw(looks[-1], batch, random), looks)).sum())
        done += batch
    promised = looks[-1] * drawn_from >= trial.runs
    return Rate(trial.what, looks, count, comparisons, trial.promise if promised else NONE)
