"""
What the self-test tries: kinds of comparisons, what is counted of each, and what is promised.

Most are drawn by chance. Stored rows and equal noise are tried once: there is no chance in them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.comparison import statistics
from flexaxis.experiments.comparison.ranking import REFERENCE
from flexaxis.experiments.gate.decide import (
    ALPHA,
    BETTER,
    SAME,
    SHARES,
    UNDECIDED,
    UNSEEN,
    WORSE,
    Family,
)
from flexaxis.experiments.gate.gate import Question, at_equal_noise, compare
from flexaxis.experiments.gate.pairs import LOST, ScoreRows
from flexaxis.experiments.gate.stored import compare_rows
from flexaxis.experiments.running.bench import Bench, Runs
from flexaxis.sim.scenario import Scenario
from tests.experiments.selftest_resampling import Drawn, Judged, Pool, draw

NOTHING = "–"  # promised

NULL_LOST = (0.0, 0.05, 0.10)
"""Shares of runs that both sides lose by chance."""

MORE_LOST = (0.05, 0.10, 0.20, 0.40, 0.70)
"""Shares of runs that the candidate alone loses."""

SMALL = 0.015  # a change below the margin

ENOUGH, MANY = 32, 64  # runs from which on power is promised

Draw = Callable[[int, int, np.random.Generator], Drawn]
Count = Callable[[Judged], NDArray[np.bool_]]


@dataclass(frozen=True)
class Promise:
    """What a rate may be: `most` and its upper 95 % limit `upper`, or `least`; all optional."""

    most: float = 1.0
    upper: float = 1.0
    least: float = 0.0

    def __str__(self) -> str:
        if self.least:
            return f"≥ {100 * self.least:g} %"
        return f"≤ {100 * self.most:g} %" if self.most < 1 else NOTHING


NONE = Promise()
FALSE_ALARMS = Promise(most=0.01, upper=0.015)
RARE = Promise(most=0.02)
INSIDE = Promise(most=0.01)
LOOK = Promise(most=0.10)
POWER = Promise(least=0.99)
SURE = Promise(least=1.0)


@dataclass(frozen=True)
class Trial:
    """A kind of comparison, and what is counted of it.

    Attributes
    ----------
    what : str
    draw : callable of (seeds, comparisons, random)
    count : callable
        Which of the judged comparisons are counted.
    promise : Promise
    runs : int
        The promise holds for comparisons of this many runs, over all scenarios, and more.
    """

    what: str
    draw: Draw
    count: Count
    promise: Promise = NONE
    runs: int = 0


def trials(same: Mapping[str, Pool], changed: Pool | None) -> Iterator[Trial]:
    """Yield all that the self-test tries.

    Parameters
    ----------
    same : mapping of str to Pool
        Each base against itself; the first of them is the one that runs are taken from.
    changed : Pool or None
        The first base against a planted change.
    """
    for name, pool in same.items():
        for share in NULL_LOST:
            what = f"{name} against itself" + (f", {100 * share:g} % of runs lost" if share else "")
            null = _drawing(pool, swap=True, lose=(share, share))
            yield Trial(f"{what}: false alarm", null, _either, FALSE_ALARMS)
            if share and name == next(iter(same)):
                yield Trial(f"{what}: status 3", null, _status(3), LOOK)
    for scenarios in (1, 4):
        for sign, what in ((1, "quicker, one far slower"), (-1, "slower, one far quicker")):
            text = f"9 of 10 runs 5 % {what}, {scenarios} scenario{'s'[: scenarios - 1]}"
            rare = _rare_failures(scenarios, sign)
            yield Trial(f"{text}: false alarm", rare, _either, RARE)
    for name, pool in same.items():
        text = f"{name}, every score {100 * SMALL:g} % larger: called worse"
        yield Trial(text, _shifted(pool), _worse, INSIDE)
    if changed is not None:
        yield Trial("planted change: called worse", _drawing(changed), _worse, POWER, MANY)
    yield from _found(next(iter(same.values())))


def _found(pool: Pool) -> Iterator[Trial]:
    """Yield what is made so large that the gate must find it, one thing at a time."""
    for metric in dict.fromkeys(pool.family.metrics.tolist()):
        one = _moved(pool, int(np.argmax(pool.family.metrics == metric)), 1)
        yield Trial(f"one {metric} far larger: called worse", one, _worse, POWER)
    yield Trial("every score far smaller: called better", _moved(pool, None, -1), _better, POWER)
    for way in LOST:
        said = {"diverged": "loses", "never_settled": "does not settle in"}[way]
        for share in MORE_LOST:
            more = _drawing(pool, swap=True, lose=(0.0, share), way=way)
            text = f"candidate {said} {100 * share:g} % of runs"
            sure, seen = share >= MOST, share >= SEEN
            yield Trial(f"{text}: status 1", more, _status(1), POWER if sure else NONE, ENOUGH)
            yield Trial(
                f"{text}: status 1 or 3", more, _status(1, 3), POWER if seen else NONE, MANY
            )
        back = _drawing(pool, swap=True, lose=(MOST, 0.0), way=way)
        text = f"base {said} {100 * MOST:g} % of runs: called better"
        yield Trial(text, back, lambda found: found.better, POWER, ENOUGH)


MOST, SEEN = 0.7, 0.2
"""Shares of runs lost from which on the gate must say worse, and must not let pass."""


def _status(*wanted: int) -> Count:
    return lambda found: np.isin(found.status, wanted)


def _better(found: Judged) -> NDArray[np.bool_]:
    return np.asarray(found.word == BETTER)


def _either(found: Judged) -> NDArray[np.bool_]:
    return found.worse | found.better


def _worse(found: Judged) -> NDArray[np.bool_]:
    return found.worse


def _drawing(
    pool: Pool,
    *,
    swap: bool = False,
    lose: tuple[float, float] = (0.0, 0.0),
    way: str = "diverged",
) -> Draw:
    return lambda size, count, random: draw(
        pool, size, count, random, swap=swap, lose=lose, way=way
    )


def _moved(pool: Pool, score: int | None, sign: int) -> Draw:
    """Move one score of the candidate, or all, by twice what so many runs can say, and more."""

    def drawn(size: int, count: int, random: np.random.Generator) -> Drawn:
        found = draw(pool, size, count, random, swap=True)
        _, _, sd = statistics.summary(pool.ratios)
        number = len(pool.family.metrics)
        share = np.where(pool.family.guards, SHARES["guards"], SHARES["scores"])
        half = statistics.half_width(sd, size, share * ALPHA / LOOKS / number)
        ways = len(np.unique(pool.family.scenarios))  # to choose one of them
        unseen = statistics.unseen_shift(size, ALPHA / LOOKS / ways, UNSEEN)
        shift = sign * (2 * (pool.family.margins + half + unseen) + 4 * sd)
        if score is not None:
            shift = np.where(np.arange(number) == score, shift, 0.0)
        return replace(found, ratios=found.ratios + shift[:, None])

    return drawn


LOOKS = 4  # at most, in the comparisons drawn: each has its share of the error


def _shifted(pool: Pool) -> Draw:
    """Make every score of the candidate larger by `SMALL`."""

    def drawn(size: int, count: int, random: np.random.Generator) -> Drawn:
        found = draw(pool, size, count, random, swap=True)
        return replace(found, ratios=found.ratios + math.log1p(SMALL))

    return drawn


def _rare_failures(scenarios: int, sign: int) -> Draw:
    """Make log-ratios with mean zero: ln .95 on nine runs of ten, and on one what makes up."""
    step = -math.log(0.95)
    names = [str(i) for i in range(scenarios)]
    family = Family.of(names, ["lag"] * scenarios, [0.02] * scenarios)

    def drawn(size: int, count: int, random: np.random.Generator) -> Drawn:
        failed = random.random((count, scenarios, size)) < 0.1
        none = np.zeros((2, count, scenarios, size), bool)
        return Drawn(family, sign * np.where(failed, 9 * step, -step), dict.fromkeys(LOST, none))

    return drawn


FAILED = 0.85  # share of the candidate's cases that fail
SLOWER = 1.5  # times the lag of the candidate, at every turn of its knob
MARK = "1e-12"
TURNED = f"{REFERENCE}[forgetting=0.99,regularization={MARK}]"
"""The reference with its knob elsewhere; the other option, which does nothing, tells its rows."""

Tried = tuple[str, bool]  # what should be said, and whether it is


def stored(base: ScoreRows, margins: Mapping[str, float]) -> Iterator[Tried]:
    """Yield what is said of an estimator's rows beside the same with something the matter.

    Parameters
    ----------
    base : mapping
        As from `flexaxis.experiments.gate.pairs.table`.
    margins : mapping of metric to float
    """
    same = compare_rows(base, base, margins)
    yield "stored, the same rows: called the same", same.verdict == SAME
    cases = base.index.droplevel("parameter").unique()
    found = compare_rows(base, _failing(base, cases[: round(FAILED * len(cases))]), margins)
    yield f"stored, {100 * FAILED:g} % of the cases failed: called worse", found.verdict == WORSE
    found = compare_rows(base, _failing(base, cases[:1]), margins)
    yield "stored, one case failed: status 3", found.status() == 3
    fewer = base[base.index.get_level_values("scenario") != cases[0][0]]
    if len(fewer):
        found = compare_rows(base, fewer, margins)
        right = (found.verdict, found.status()) == (UNDECIDED, 3)
        yield "stored, the candidate lacks a scenario: undecided, status 3", right
        found = compare_rows(fewer, base, margins)
        yield "stored, the base lacks a scenario: undecided", found.verdict == UNDECIDED


def _failing(rows: ScoreRows, cases: Any) -> ScoreRows:
    found = rows.copy()
    found.loc[rows.index.droplevel("parameter").isin(cases), ["failed", "diverged"]] = True
    return found


def equal_noise(
    scenarios: Sequence[Scenario],
    margins: Mapping[str, float],
    seeds: Sequence[int],
    bench: Bench,
) -> Iterator[Tried]:
    """Yield what is said of the reference beside itself with its knob elsewhere, and slower.

    Parameters
    ----------
    scenarios : sequence of Scenario
    margins : mapping of metric to float
    seeds : sequence of int
    bench : Bench
    """
    question = at_equal_noise(Question(REFERENCE, TURNED, scenarios, seeds, margins), bench)
    word = compare(question, bench).verdict
    yield "equal noise, another knob: not worse, not better", word not in {WORSE, BETTER}
    word = compare(question, _Slower(bench)).verdict
    yield f"equal noise, {SLOWER:g} × the lag: called worse", word == WORSE


class _Slower(Bench):
    """A bench on which one estimator lags more than it does, and is as noisy."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def runs(
        self, scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int]
    ) -> dict[tuple[str, str], Runs]:
        """Return the rows of some cases."""
        return self.with_failed(scenarios, estimators, seeds)

    def with_failed(
        self, scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int]
    ) -> dict[tuple[str, str], Runs]:
        """Return the same."""
        found = self._bench.with_failed(scenarios, estimators, seeds)
        return {
            key: [[_slower(row) for row in run] for run in runs] if MARK in key[1] else runs
            for key, runs in found.items()
        }


def _slower(row: dict[str, Any]) -> dict[str, Any]:
    return row | {"lag": row["lag"] and SLOWER * row["lag"]}
