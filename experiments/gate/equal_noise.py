"""Compare at equal noise: tune both sides to the same noise, then compare their lags.

The tuning parameters are adjusted on tuning seeds until both estimators are as noisy as the
reference. On the seeds of the comparison their noise still differs by chance. So the candidate
also runs at neighbouring settings, and its lag is interpolated where it is exactly as noisy as the
base (`flexaxis.experiments.comparison.sweep`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from flexaxis.experiments.comparison.matching import Noise
from flexaxis.experiments.comparison.ranking import MATCHED
from flexaxis.experiments.comparison.sweep import Run, Runs
from flexaxis.experiments.comparison.tune import EXCESS, Tuned
from flexaxis.experiments.gate.pairs import SIDES, Gap, Paired
from flexaxis.sim.scenario import Scenario

SEEDS = tuple(range(16))
"""Seeds for tuning."""

TURNS = (1 / 1.2, 1.0, 1.2)  # of the candidate's knob, about its setting
FURTHER = (1.6, 4.0, 16.0)  # and its inverse, where all are noisier than the base, or all quieter


def at_equal_noise(
    paired: Paired, base: Tuned, candidate: Tuned, *,
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
            pairs=[(row["parameter"], noise)], whole=True,
        ).values()  # fmt: skip
        if match is None or match.how != MATCHED:
            text = "the noise of {parameter} at {scenario} has no match"
            gaps.append(Gap("candidate", text.format(**row)))
            continue
        logs = np.array([match.reference.at("lag"), match.at("lag")])
        sides = dict(zip(SIDES, np.exp(logs.mean(axis=1)), strict=True))
        lags.append(row | sides | {"changes": logs[1] - logs[0], "scale": np.nan})
    return replace(paired, scores=pd.DataFrame(lags), gaps=gaps)
