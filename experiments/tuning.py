"""Find the setting of an estimator's knob that gives it the standard deviation of the reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments import harness
from flexaxis.experiments.cache import RecordCache
from flexaxis.experiments.catalogue import find_scenario
from flexaxis.experiments.summary import pool
from flexaxis.experiments.tradeoff import REFERENCE, with_knob
from flexaxis.sim.errors import FlexaxisError

TOLERANCE = 0.01  # of the matched standard deviation
ROUNDS = 12


@dataclass(frozen=True)
class Tuned:
    """A setting found.

    Attributes
    ----------
    setting : str
        The estimator with its knob, as for `--estimator`.
    ratio : float
        Geometric mean over the parameters of std over that of the reference.
    ratios : dict of str to float
        The same of each parameter.
    """

    setting: str
    ratio: float
    ratios: dict[str, float]


def match_std(
    name: str, seeds: Sequence[int], *, jobs: int = 1, store: RecordCache | None = None
) -> Tuned:
    """
    Turn the knob until std is that of `rpem-forgetting` at its default, on the nominal axis.

    Secant steps in the logarithms; std grows with every registered knob's speed.

    Parameters
    ----------
    name : str
        A registered estimator with a knob.
    seeds : sequence of int
        Those for tuning.
    jobs, store
        As for `flexaxis.experiments.harness.run`.

    Raises
    ------
    FlexaxisError
        If the estimator has no knob, or no setting is found.
    """
    if name in REGISTRY and REGISTRY[name].knob is None:
        raise FlexaxisError(f"{name} has no knob to turn")
    scenario = find_scenario("paper_nominal-v1").override({"start": 1.0})

    def stds(setting: str) -> dict[str, float]:
        done = harness.run([scenario], [setting], seeds, jobs=jobs, store=store)
        rows, _ = pool([case for task in done for case in task.cases], [scenario])
        return {row["parameter"]: row["std"] for row in rows if row["std"]}

    reference = stds(with_knob(REFERENCE, 1.0))
    factor, slope, before = 1.0, 0.5, None
    for _ in range(ROUNDS):
        setting = with_knob(name, factor)
        own = stds(setting)
        ratios = {p: own[p] / reference[p] for p in reference if p in own}
        if not ratios:
            break
        error = float(np.mean(np.log(list(ratios.values()))))
        if abs(error) < TOLERANCE:
            return Tuned(setting, float(np.exp(error)), ratios)
        if before is not None and abs(np.log(factor) - before[0]) > 1e-6:
            slope = np.clip((error - before[1]) / (np.log(factor) - before[0]), 0.1, 2.0)
        before = np.log(factor), error
        factor = float(factor * np.exp(np.clip(-error / slope, -1.5, 1.5)))
    raise FlexaxisError(
        f"{name}: no setting of its knob has the standard deviation of {REFERENCE} "
        f"(last tried {setting})"
    )
