"""Compare two estimators at equal noise: tune both to the same noise, then compare their lags.

The tuning uses its own seeds and makes both estimators as noisy as a reference estimator. With the
seeds of the comparison, the noise levels of the two estimators still differ by chance. Therefore
the candidate also runs at neighbouring settings, and its lag is interpolated to exactly the noise
of the base (`flexaxis.experiments.comparison.sweep`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from flexaxis.experiments.comparison.noise_interpolation import Noise
from flexaxis.experiments.comparison.ranking import MATCHED
from flexaxis.experiments.comparison.sweep import Run, Runs
from flexaxis.experiments.comparison.tune import EXCESS, Tuned
from flexaxis.experiments.gate.pairs import SIDES, Gap, Paired
from flexaxis.sim.scenario import Scenario

SEEDS = tuple(range(16))
"""Seeds for tuning."""

TURNS = (1 / 1.2, 1.0, 1.2)  # settings of the candidate relative to the tuned setting
FURTHER = (1.6, 4.0, 16.0)  # more relative settings (or their inverses) if TURNS are not enough


def at_equal_noise(
    paired: Paired, base: Tuned, candidate: Tuned, *,
    scenarios: Sequence[Scenario], run: Run, seeds: Sequence[int],
) -> Paired:  # fmt: skip
    """Replace paired lags by lags at equal noise; add a `Gap` for each fault with unmatched noise.

    Parameters
    ----------
    paired : Paired
        Paired scores of the two tuned estimators.
    base, candidate : Tuned
        Tuned settings of the two estimators.
    scenarios : sequence of Scenario
        Scenarios of the comparison.
    run : callable
        Function ``run(scenarios, estimators, seeds)`` that returns the scores of all runs.
    seeds : sequence of int
        Seeds of the comparison, which must differ from the tuning seeds.
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
            text = "no candidate setting matches the base noise for {parameter} on {scenario}"
            gaps.append(Gap("candidate", text.format(**row)))
            continue
        logs = np.array([match.reference.at("lag"), match.at("lag")])
        sides = dict(zip(SIDES, np.exp(logs.mean(axis=1)), strict=True))
        lags.append(row | sides | {"changes": logs[1] - logs[0], "scale": np.nan})
    return replace(paired, scores=pd.DataFrame(lags), gaps=gaps)
