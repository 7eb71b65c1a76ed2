"""What an estimator is worth to the controller that follows it, in a loop of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flexaxis.experiments.building.estimator_text import Spec
from flexaxis.experiments.building.guest import hosted
from flexaxis.experiments.building.ready import ready
from flexaxis.experiments.scoring.windows import remembered, windows
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import tracked
from flexaxis.sim.tables.feed_forward import Follower


class Told:
    """Who is told the truth, and in time: before each command, the parameters that act on it."""

    output = "speed"

    def __init__(self, scenario: Scenario) -> None:
        self.names, truth = scenario.parameter_names, scenario.true_parameters()
        self._truth, self._next = [*truth[1:], truth[-1]], 0

    def step(self, u: float, y: float) -> Sequence[float]:
        """Return the parameters that act from the next sample on."""
        self._next += 1
        return self._truth[self._next - 1]  # type: ignore[no-any-return]


def tracking(scenario: Scenario, seed: int, spec: Spec) -> Mapping[str, float] | None:
    """Return how well the motor follows its reference in the 5 s after the first fault.

    Parameters
    ----------
    scenario : Scenario
        As it was written; its own loop has no estimator.
    seed : int
    spec : Spec
        The estimator.

    Returns
    -------
    mapping of str to float, or None
        The root mean square tracking error [rad] ``without_fault``, with the fault ``frozen`` (the
        feed-forward stays nominal), ``told`` the truth and as ``estimated``; and ``limited``, the
        samples until then in which limits acted on what was estimated. None where nothing is fed
        forward, or nothing fails.

    Raises
    ------
    EstimatorError, SimulationError
    """
    if scenario.controller.adapt is None or not scenario.fault:
        return None
    mine = scenario.drawn(seed)
    with hosted(spec.text, f"in the loop of {scenario.name}, seed {seed}"):
        rms, limited = _rms(scenario, [mine], seed, [ready(spec, mine)])
    others = _others(scenario, seed)
    return {**others, "estimated": rms[0], "limited": float(limited[0])}


@remembered()
def _others(scenario: Scenario, seed: int) -> Mapping[str, float]:
    """Return what does not depend on the estimator."""
    mine = scenario.drawn(seed)
    whole = mine.override({"fault": []}, inherit=True)
    rms, _ = _rms(scenario, [mine, mine, whole], seed, [None, Told(mine), None])
    return dict(zip(("frozen", "told", "without_fault"), rms, strict=True))


def _rms(
    scenario: Scenario, runs: Sequence[Scenario], seed: int, followers: Sequence[Follower | None]
) -> tuple[list[float], Sequence[int]]:
    first = windows(runs[0], runs[0].identify)[0]
    error, limited = tracked(scenario, runs, seed, followers, samples=first.stop)
    scored = error[first.start : first.stop]
    return np.sqrt(np.mean(scored**2, axis=0)).tolist(), limited.tolist()
