"""Compare at equal noise: tune both sides to one noise, then read the lag off at equal noise.

The tuning parameters are turned on seeds for tuning, until both are as noisy as the reference. On
the seeds of the comparison that leaves them equal but for chance, so the candidate runs at
neighbouring settings as well, and its lag is read off where it is exactly as noisy as the base
there (`flexaxis.experiments.comparison.sweep`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from flexaxis.experiments.comparison.ranking import MATCHED
from flexaxis.experiments.comparison.sweep import Noise, Run, Runs
from flexaxis.experiments.comparison.tune import EXCESS, Trials, Tuned, match_noise
from flexaxis.experiments.gate.pairs import SIDES, Gap, Paired
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario

SEEDS = tuple(range(16))
"""Seeds for tuning."""

TURNS = (1 / 1.2, 1.0, 1.2)  # of the candidate's knob, about its setting
FURTHER = (1.6, 4.0, 16.0)  # and its inverse, where all are noisier than the base, or all quieter


def at_equal_noise(
    paired: Paired, base: Tuned, candidate: Tuned,
    scenarios: Sequence[Scenario], run: Run, seeds: Sequence[int],
) -> Paired:  # fmt: skip
    """Return the lags read off at equal noise; a fault that has no match is a gap.

    Parameters
    ----------
    paired : Paired
        Of the two settings as they are.
    base, candidate : Tuned
    scenarios : sequence of Scenario
    run : callable
    seeds : sequence of int
        Of the comparison.
    """
    noise: Noise = "excess" if base.match == EXCESS else "std"
    turn, runs = candidate.turned, Runs(run, seeds)
    lags, gaps = [], [*paired.gaps]
    for row in paired.scores.query("metric == 'lag'").to_dict("records"):
        (scenario,) = (s for s in scenarios if s.name == row["scenario"])
        line = {t: f for f in TURNS if (t := turn(f)) and runs.able(scenario, t)}
        (match,) = runs.matches(
            scenario, base.setting, line, turn, FURTHER,
            wanted=[(row["parameter"], noise)], whole=True,
        ).values()  # fmt: skip
        if match is None or match.how != MATCHED:
            gaps.append(
                Gap(
                    "candidate",
                    "the noise of {parameter} at {scenario} has no match".format(**row),
                )
            )
            continue
        logs = np.array([match.reference.at("lag"), match.at("lag")])
        sides = dict(zip(SIDES, np.exp(logs.mean(axis=1)), strict=True))
        lags.append(row | sides | {"changes": logs[1] - logs[0], "scale": np.nan})
    return replace(paired, scores=pd.DataFrame(lags), gaps=gaps)


def tuned(
    base: str, candidate: str, scenarios: Sequence[Scenario], run: Run, seeds: Sequence[int] = SEEDS
) -> list[Tuned]:
    """Turn the tuning parameters of two estimators until both are as noisy as the reference.

    Where one parameter alone changes in these scenarios, the std of that parameter is equal; where
    several do, the excess prediction error, which is one number for all.

    Parameters
    ----------
    base, candidate : str
        Texts as for `--estimator`; a tuning parameter that is set in them is turned, other options
        stay.
    scenarios : sequence of Scenario
        Noise is taken before their faults.
    run : callable
    seeds : sequence of int
        For tuning.

    Raises
    ------
    FlexaxisError
        If one of them has no tuning parameter, nothing changes that both estimate, or no setting
        reaches the noise.
    """
    first, texts = Runs(run, seeds[:1]), (base, candidate)
    changing = [set[str].intersection(*({*first.changed(s, t)} for t in texts)) for s in scenarios]
    every = set[str]().union(*changing)
    if not every:
        raise FlexaxisError(
            "--match-std: no scenario has a fault in a parameter that both estimate, so there is "
            "no lag to compare. Name one that has (`flexaxis list`)"
        )
    match = EXCESS if len(every) > 1 else every.pop()
    where = [s for s, names in zip(scenarios, changing, strict=True) if names]
    trials = Trials(seeds, run, match, where)
    return [match_noise(text, trials) for text in texts]
