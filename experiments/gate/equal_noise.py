"""Compare at equal noise: both sides tuned to one noise first, then scores read off at equal noise.

The knobs are turned on seeds for tuning, until both are as noisy as the reference. On the seeds of
the comparison that leaves them equal but for chance, so the candidate runs at neighbouring turns
of its knob as well, and its scores are read off where it is exactly as noisy as the base there
(`flexaxis.experiments.comparison.matching`); the jackknife over seeds holds what is uncertain
of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building.estimator_text import written_options
from flexaxis.experiments.comparison.matching import MATCHED, Match, Noise, Setting, match, plain
from flexaxis.experiments.gate.pairs import Paired, Pairs
from flexaxis.experiments.running.bench import Bench, Runs
from flexaxis.experiments.running.work import Row
from flexaxis.experiments.storage.files import StudyError
from flexaxis.experiments.studies.knobs import knob_of, setting
from flexaxis.experiments.studies.tuning import (
    EXCESS,
    ROUNDS,
    NoMatchError,
    Trials,
    Tuned,
    match_noise,
)
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario

ASKED = "--match-std (in Python match_std=True)"
SEEDS = tuple(range(16))
"""Those for tuning: no comparison has them unless it asks for them."""

TURNS = (1 / 1.2, 1.0, 1.2)  # of the candidate's knob, about its setting
FURTHER = (1.6, 4.0, 16.0)  # and its inverse, where all are noisier than the base, or all quieter
NOISES = ("std", "excess", "bias")  # what is equal is not judged, and neither what is beside it


@dataclass(frozen=True)
class EqualNoise:
    """The settings at which two estimators are equally noisy.

    Attributes
    ----------
    match : str
        What is equal: "excess", or the parameter whose std is.
    base, candidate : Tuned
    seeds : tuple of int
        On which they were tuned.
    left_out : tuple of str
        Scenarios on which no setting reaches the noise: what is equal is that on the others.
    """

    match: str
    base: Tuned
    candidate: Tuned
    seeds: tuple[int, ...]
    left_out: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return what goes into compare.json."""
        sides = {"base": asdict(self.base), "candidate": asdict(self.candidate)}
        about = {"match": self.match, "seeds": list(self.seeds), "left_out": list(self.left_out)}
        return about | sides

    def apply(
        self, paired: Paired, scenarios: Sequence[Scenario], bench: Bench, seeds: Sequence[int]
    ) -> tuple[Paired, tuple[tuple[str, str], ...]]:
        """Return what is paired, read off at equal noise, and what of it could not be matched.

        Parameters
        ----------
        paired : Paired
            Of the two settings as they are.
        scenarios : sequence of Scenario
        bench : Bench
        seeds : sequence of int
            Of the comparison.
        """
        by_name, side = {s.name: s for s in scenarios}, _Side(self, bench, seeds)
        scores, unmatched = [], []
        for item in (p for p in paired.scores if p.metric not in NOISES):
            if not side.changed(by_name[item.scenario], item.parameter):
                scores.append(item)
            elif (found := side.matched(by_name[item.scenario], item)) is not None:
                scores.append(found)
            else:
                unmatched.append((item.scenario, item.parameter))
        return replace(paired, scores=scores), tuple(dict.fromkeys(unmatched))


def at_one_noise(
    base: str,
    candidate: str,
    scenarios: Sequence[Scenario],
    bench: Bench,
    seeds: Sequence[int] = SEEDS,
) -> EqualNoise:
    """Turn the knobs of two estimators until both are as noisy as the reference.

    Where one parameter alone changes in these scenarios, the std of that parameter is equal; where
    several do, the excess prediction error, which is one number for all.

    Parameters
    ----------
    base, candidate : str
        Texts as for `--estimator`; a knob that is set in them is turned, other options stay.
    scenarios : sequence of Scenario
        Noise is taken before their faults.
    bench : Bench
    seeds : sequence of int
        For tuning.

    Raises
    ------
    FlexaxisError
        If one of them has no knob, nothing changes that both estimate, or no setting of a knob
        reaches the noise.
    """
    for text in (base, candidate):  # said before anything is run
        _parts(text)
    wanted, where, left_out = _what(base, candidate, scenarios, bench, seeds)
    trials = Trials(seeds, bench, wanted, where)
    try:
        both = _tuned(base, trials), _tuned(candidate, trials)
    except NoMatchError as error:
        kept = [s for s in where if s.name not in error.scenarios]
        if not kept or len(kept) == len(where):
            raise _asked(error) from error
        left_out += tuple(s.name for s in where if s.name in error.scenarios)
        trials = Trials(seeds, bench, wanted, kept)
        try:
            both = _tuned(base, trials), _tuned(candidate, trials)
        except NoMatchError as again:
            raise _asked(again) from again
    return EqualNoise(wanted, *both, tuple(seeds), left_out)


def _asked(error: FlexaxisError) -> FlexaxisError:
    return FlexaxisError(f"{ASKED}: {error}; see `flexaxis tune --sweep`")


def work(scenarios: int, first: int, last: int) -> int:
    """Return how many cases more it takes at most to compare at equal noise.

    Parameters
    ----------
    scenarios : int
    first, last : int
        Seeds of the first look, and of the last.
    """
    tuned = 2 * (1 + 2 * ROUNDS) * min(first, len(SEEDS))
    beside = len(TURNS) - 1 + 2 * len(FURTHER)
    return scenarios * (tuned + (1 + beside) * last)


def _parts(text: str) -> tuple[str, dict[str, Any]]:
    """Return the name of an estimator, and its options without those of the knob."""
    options = written_options(text)
    name = text.partition("[")[0].strip() if options else text
    knob = knob_of(name)
    if knob is None:
        raise FlexaxisError(
            f"{ASKED}: {text} has no knob to turn, so it cannot be made as noisy as another. "
            'Name the option that buys speed with noise in its class (knob = "gain"), or compare '
            "without it"
        )
    return name, {key: value for key, value in options.items() if key not in knob.names}


def _tuned(text: str, trials: Trials) -> Tuned:
    name, options = _parts(text)
    try:
        return match_noise(name, trials, options)
    except NoMatchError:
        raise
    except FlexaxisError as error:
        raise _asked(error) from error


def _what(
    base: str, candidate: str, scenarios: Sequence[Scenario], bench: Bench, seeds: Sequence[int]
) -> tuple[str, list[Scenario], tuple[str, ...]]:
    """Return what is to be equal, the scenarios on which, and those on which it is not defined."""
    runs = bench.runs(scenarios, (base, candidate), seeds[:1])
    changing = {
        s.name: _changing(runs[s.hash, base][0]) & _changing(runs[s.hash, candidate][0])
        for s in scenarios
    }
    every = set().union(*changing.values())
    if not every:
        raise FlexaxisError(
            f"{ASKED}: no scenario has a fault in a parameter that both estimate, so there is "
            "no lag to compare; name one that has (`flexaxis list`)"
        )
    if len(every) == 1:
        return every.pop(), [s for s in scenarios if changing[s.name]], ()
    lacking = {
        s.name: text
        for s in scenarios
        for text in (base, candidate)
        if runs[s.hash, text][0][0]["excess"] is None
    }
    where = [s for s in scenarios if s.name not in lacking]
    if not where:
        raise FlexaxisError(
            f"{ASKED}: the faults are in {', '.join(sorted(every))}, so that the excess "
            f"prediction error is to be equal, and {', '.join(sorted({*lacking.values()}))} does "
            f"not estimate all that it takes on {', '.join(lacking)}: name scenarios in which one "
            "parameter changes"
        )
    return EXCESS, where, tuple(lacking)


def _changing(rows: Sequence[Row]) -> set[str]:
    return {row["parameter"] for row in rows if row["changed"]}


class _Side:
    """The candidate at several turns of its knob, beside the base, on the seeds compared."""

    def __init__(self, equal: EqualNoise, bench: Bench, seeds: Sequence[int]) -> None:
        self._equal, self._bench, self._seeds = equal, bench, seeds
        self._noise: Noise = "excess" if equal.match == EXCESS else "std"
        self._runs: dict[tuple[str, str], Runs] = {}
        self._found: dict[tuple[str, str], tuple[Match | None, Setting]] = {}

    def changed(self, scenario: Scenario, parameter: str) -> bool:
        """Whether a parameter changes in a scenario."""
        return parameter in _changing(self._of(scenario, self._equal.base.setting)[0])

    def matched(self, scenario: Scenario, item: Pairs) -> Pairs | None:
        """Return a score at equal noise; as it is where the score is not defined there."""
        key = scenario.hash, item.parameter
        if key not in self._found:
            self._found[key] = self._match(scenario, item.parameter)
        found, base = self._found[key]
        if found is None or found.how != MATCHED:
            return None
        first, second = plain(base, item.metric), found.at(item.metric)
        if first is None or second is None:
            return item
        here = np.searchsorted(item.seeds, [row["seed"] for row in base.rows])
        sides = np.full((2, len(item.seeds)), np.nan)
        sides[:, here] = np.exp([first, second])
        return replace(item, base=sides[0], candidate=sides[1], scale=None)

    def _match(self, scenario: Scenario, parameter: str) -> tuple[Match | None, Setting]:
        turns = list(TURNS)
        found, base = self._at(scenario, parameter, turns)
        for further in FURTHER:
            if found is None or found.how == MATCHED:
                break
            turns += [1 / further, further]
            found, base = self._at(scenario, parameter, turns)
        return found, base

    def _at(
        self, scenario: Scenario, parameter: str, turns: Sequence[float]
    ) -> tuple[Match | None, Setting]:
        base, line = self._of(scenario, self._equal.base.setting), {}
        for turn in turns:
            with suppress(EstimatorError, StudyError):  # so far the knob does not turn
                text = self._text(turn)
                line[text] = turn, self._of(scenario, text)
        sides = [base, *(runs for _, runs in line.values())]
        kept = [i for i in range(len(base)) if not any(_lost(runs[i]) for runs in sides)]

        beside, *own = (
            Setting.of(text, turn, [runs[i] for i in kept], parameter, scenario)
            for text, (turn, runs) in [(self._equal.base.setting, (1.0, base)), *line.items()]
        )
        return (match(beside, own, self._noise) if len(kept) > 1 else None), beside

    def _text(self, turn: float) -> str:
        tuned = self._equal.candidate
        if turn == 1.0:
            return tuned.setting
        name, options = _parts(tuned.setting)
        knob = knob_of(name)
        found = knob and knob.at(knob.position(tuned.value) * turn)
        if not found:
            raise EstimatorError(f"{name}: its knob does not turn so far")
        return setting(name, {**options, **found})

    def _of(self, scenario: Scenario, text: str) -> Runs:
        if (scenario.hash, text) not in self._runs:
            self._runs |= self._bench.runs([scenario], [text], self._seeds)
        return self._runs[scenario.hash, text]


def _lost(rows: Sequence[Mapping[str, Any]]) -> bool:
    return any(row["diverged"] for row in rows)
