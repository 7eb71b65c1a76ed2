"""Compare at equal noise: tune both sides to one noise, then read the scores off at equal noise.

The knobs are turned on seeds for tuning, until both are as noisy as the reference. On the seeds of
the comparison that leaves them equal but for chance, so the candidate runs at neighbouring settings
as well, and its scores are read off where it is exactly as noisy as the base there
(`flexaxis.experiments.comparison.matching`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from flexaxis.experiments.comparison.matching import MATCHED, Match, Noise, Run, plain
from flexaxis.experiments.comparison.sweep import Runs
from flexaxis.experiments.comparison.tune import (
    EXCESS,
    NoMatchError,
    Trials,
    Tuned,
    knob_of,
    match_noise,
    setting,
)
from flexaxis.experiments.gate.pairs import Paired
from flexaxis.experiments.running.estimators import written_options
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario

ASKED = "--match-std (in Python match_std=True)"
SEEDS = tuple(range(16))
"""Seeds for tuning."""

TURNS = (1 / 1.2, 1.0, 1.2)  # of the candidate's knob, about its setting
FURTHER = (1.6, 4.0, 16.0)  # and its inverse, where all are noisier than the base, or all quieter
NOISES = ("std", "excess", "bias")  # what is equal is not judged


@dataclass(frozen=True)
class EqualNoise:
    """The settings at which two estimators are equally noisy.

    Attributes
    ----------
    match : str
        What is equal: "excess", or the parameter whose std is.
    base, candidate : Tuned
    seeds : sequence of int
        On which they were tuned.
    left_out : sequence of str
        Scenarios on which no setting reaches the noise: it is equal on the others.
    """

    match: str
    base: Tuned
    candidate: Tuned
    seeds: Sequence[int]
    left_out: Sequence[str] = ()

    def apply(
        self, paired: Paired, scenarios: Sequence[Scenario], run: Run, seeds: Sequence[int]
    ) -> tuple[Paired, list[tuple[str, str]]]:
        """Return the scores read off at equal noise, and the faults that could not be matched.

        Parameters
        ----------
        paired : Paired
            Of the two settings as they are.
        scenarios : sequence of Scenario
        run : callable
        seeds : sequence of int
            Of the comparison.
        """
        noise: Noise = "excess" if self.match == EXCESS else "std"
        judged = paired.scores[~paired.scores["metric"].isin(NOISES)]
        runs, scores, unmatched = Runs(run, seeds), [judged.iloc[:0]], []
        for (name, parameter), own in judged.groupby(["scenario", "parameter"]):
            scenario = next(s for s in scenarios if s.name == name)
            if parameter in runs.changed(scenario, self.base.setting):
                line = {t: f for f in TURNS if (t := self._turn(f)) and runs.able(scenario, t)}
                (match,) = runs.matches(
                    scenario, self.base.setting, line, self._turn, FURTHER,
                    wanted=[(parameter, noise)], whole=True,
                ).values()  # fmt: skip
                if match is None or match.how != MATCHED:
                    unmatched.append((name, parameter))
                    continue
                scores.append(own.apply(_read_off, axis=1, match=match))
            else:
                scores.append(own)
        return replace(paired, scores=pd.concat(scores)), unmatched

    def _turn(self, factor: float) -> str | None:
        """Return the candidate with its knob turned about the setting that was tuned."""
        if factor == 1:
            return self.candidate.setting
        name, options = _parts(self.candidate.setting)
        knob = knob_of(name)
        turned = knob and knob.at(knob.position(self.candidate.value) * factor)
        return setting(name, {**options, **turned}) if turned else None


def _read_off(score: pd.Series, match: Match) -> pd.Series:
    """Return a score at equal noise; as it is where it is not defined there."""
    both = plain(match.reference, score["metric"]), match.at(score["metric"])
    if both[0] is None or both[1] is None:
        return score
    values = np.full((2, len(score["seeds"])), np.nan)
    values[:, np.searchsorted(score["seeds"], match.reference.rows["seed"])] = both
    read = {"values": np.exp(values), "changes": values[1] - values[0], "scale": np.nan}
    return pd.Series({**score, **read, "bias": None})


def tuned(
    base: str, candidate: str, scenarios: Sequence[Scenario], run: Run, seeds: Sequence[int] = SEEDS
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
    run : callable
    seeds : sequence of int
        For tuning.

    Raises
    ------
    FlexaxisError
        If one of them has no knob, nothing changes that both estimate, or no setting of a knob
        reaches the noise.
    """
    parts, first = [_parts(text) for text in (base, candidate)], Runs(run, seeds[:1])
    changing = {
        s.name: {*first.changed(s, base)} & {*first.changed(s, candidate)} for s in scenarios
    }
    every, match, left_out = set().union(*changing.values()), EXCESS, []
    if not every:
        raise FlexaxisError(
            f"{ASKED}: no scenario has a fault in a parameter that both estimate, so there is no "
            "lag to compare. Name one that has (`flexaxis list`)"
        )
    if len(every) == 1:
        (match,) = every
        where = [s for s in scenarios if changing[s.name]]
    else:
        texts = (base, candidate)
        where = [s for s in scenarios if all(first.of(s, t)["excess"].notna().all() for t in texts)]
        left_out = [s.name for s in scenarios if s not in where]
    while where:
        trials = Trials(seeds, run, match, where)
        try:
            both = [match_noise(name, trials, options) for name, options in parts]
            return EqualNoise(match, both[0], both[1], seeds, left_out)
        except NoMatchError as error:
            kept = [s for s in where if s.name not in error.scenarios]
            if not kept or kept == where:
                message = f"{ASKED}: {error}; see `flexaxis tune --sweep`"
                raise FlexaxisError(message) from error
            left_out += [s.name for s in where if s not in kept]
            where = kept
    raise FlexaxisError(
        f"{ASKED}: the faults are in {', '.join(sorted(every))}, so the excess prediction error is "
        "to be equal, but base or candidate does not estimate all that it takes. Name scenarios in "
        "which one parameter changes"
    )


def _parts(text: str) -> tuple[str, dict[str, Any]]:
    """Return the name of an estimator, and its options without those of the knob."""
    options = written_options(text)
    name = text.partition("[")[0].strip() if options else text
    knob = knob_of(name)
    if knob is None:
        raise FlexaxisError(
            f"{ASKED}: {text} has no knob to turn, so its noise cannot be matched. Name the option "
            'that buys speed with noise in its class (knob = "gain"), or compare without it'
        )
    return name, {key: value for key, value in options.items() if key not in knob.names}
