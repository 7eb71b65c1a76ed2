"""The gate tested on itself: how often it raises a false alarm, and what it finds.

A pool of seeds is run once: the base, the base again with an independent noise on the same
excitation and faults, and planted changes of the base. Comparisons are then drawn from it, each of
some seeds without replacement. In a comparison of the base with itself the two noises of each
seed change sides by chance, so that neither side can be better.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments import harness
from flexaxis.experiments.cache import RecordCache
from flexaxis.experiments.compare.gate import rows_of
from flexaxis.experiments.compare.pairs import Pairs, pair
from flexaxis.experiments.compare.verdicts import BETTER, VERDICTS, WORSE, judge, overall
from flexaxis.experiments.scoring.statistics import rate_interval
from flexaxis.sim.scenario import Scenario

PLANTED = "rpem-forgetting[forgetting=0.99525]"
"""About 5 % more lag than the base."""

BASE = "rpem-forgetting"
FALSE_ALARMS, UPPER, POWER = 0.01, 0.02, 0.95  # what the gate promises


@dataclass(frozen=True)
class Rates:
    """How the comparisons of one candidate came out.

    Attributes
    ----------
    candidate : str
    planted : bool
        Whether there is a change to be found.
    comparisons : int
    verdicts : dict of str to int
        Comparisons by their overall verdict.
    worse, better : int
        Comparisons with at least one score called so.
    rows : dict of str to float
        Share of the comparisons in which a score ("scenario metric parameter") is called worse.
    """

    candidate: str
    planted: bool
    comparisons: int
    verdicts: dict[str, int]
    worse: int
    better: int
    rows: dict[str, float]

    @property
    def rate(self) -> float:
        """Share called worse: false alarms, or for a planted change the power."""
        return self.worse / self.comparisons

    @property
    def interval(self) -> tuple[float, float]:
        """Exact 95 % interval of the rate."""
        return rate_interval(self.worse, self.comparisons)

    @property
    def kept(self) -> bool:
        """Whether the gate keeps its promise for this candidate."""
        if self.planted:
            return self.rate >= POWER
        return self.rate <= FALSE_ALARMS and self.interval[1] <= UPPER

    def as_dict(self) -> dict[str, Any]:
        """Return what goes into the JSON."""
        extra = {"rate": self.rate, "interval": self.interval, "kept": self.kept}
        return asdict(self) | extra


def self_test(
    scenarios: Sequence[Scenario],
    seeds: Sequence[int],
    margins: Mapping[str, float],
    *,
    base: str = BASE,
    planted: Sequence[str] = (PLANTED,),
    comparisons: int = 2000,
    pool: int = 64,
    jobs: int = 1,
    store: RecordCache | None = None,
    advance: Callable[[harness.Done], None] | None = None,
) -> list[Rates]:
    """Return the rate of false alarms of the gate, and its power on planted changes.

    Parameters
    ----------
    scenarios : sequence of Scenario
    seeds : sequence of int
        As many as a comparison uses; the pool begins with the first of them.
    margins : mapping of metric to float
    base : str
        Compared with itself.
    planted : sequence of str
        Estimators that are worse than the base, and should be called so.
    comparisons : int
        Drawn for each candidate.
    pool : int
        Seeds that are run.
    jobs, store, advance
        As in `flexaxis.experiments.compare.gate.compare`.
    """
    numbers = range(seeds[0], seeds[0] + max(pool, len(seeds)))
    cases: dict[int, list[harness.Case]] = {0: [], 1: []}
    for repeat, names in ((0, (base, *planted)), (1, (base,))):
        for done in harness.run(scenarios, names, numbers, jobs=jobs, store=store, repeat=repeat):
            cases[repeat] += done.cases
            if advance:
                advance(done)
    first, again = (rows_of(cases[repeat], base) for repeat in (0, 1))
    others = [(base, again), *((text, rows_of(cases[0], text)) for text in planted)]
    return [
        _draw(
            pair(first, rows, margins),
            margins,
            candidate=text,
            planted=rows is not again,
            size=len(seeds),
            comparisons=comparisons,
        )
        for text, rows in others
    ]


def _draw(
    pool: list[Pairs],
    margins: Mapping[str, float],
    *,
    candidate: str,
    planted: bool,
    size: int,
    comparisons: int,
) -> Rates:
    random = np.random.default_rng(0)
    seeds = pool[0].seeds
    verdicts: Counter[str] = Counter()
    called: Counter[str] = Counter()
    rows: Counter[str] = Counter()
    for _ in range(comparisons):
        drawn = random.choice(len(seeds), size, replace=False)
        swap = random.random(size) < 0.5 if not planted else np.zeros(size, bool)
        found = judge([_taken(pairs, drawn, swap) for pairs in pool], margins)
        words = [v.verdict for v in found]
        verdicts[overall(words)] += 1
        called.update({word for word in words if word in (BETTER, WORSE)})
        rows.update(
            f"{v.scenario} {v.metric} {v.parameter}".strip() for v in found if v.verdict == WORSE
        )
    return Rates(
        candidate,
        planted,
        comparisons,
        verdicts={word: verdicts[word] for word in VERDICTS},
        worse=called[WORSE],
        better=called[BETTER],
        rows={name: count / comparisons for name, count in rows.items()},
    )


def _taken(pairs: Pairs, drawn: NDArray[np.int64], swap: NDArray[np.bool_]) -> Pairs:
    base, candidate = pairs.base[drawn], pairs.candidate[drawn]
    return replace(
        pairs,
        seeds=pairs.seeds[drawn],
        base=np.where(swap, candidate, base),
        candidate=np.where(swap, base, candidate),
    )
