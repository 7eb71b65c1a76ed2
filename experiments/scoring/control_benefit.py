"""Compute the tracking error that a controller avoids by using estimates after a fault."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.scores import Track, finite
from flexaxis.experiments.scoring.windows import remembered, windows
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import tracked

Array = NDArray[np.float64]

COSTS = 0.2
"""The score `recovered` is defined only if the fault increases the tracking error by at least this
fraction."""

PARTS: Mapping[str, str] = {
    "without_fault": "rad", "frozen": "rad", "told": "rad", "estimated": "rad", "limited": ""
}  # fmt: skip
"""Units of the results from the simulated control loops, keyed by the name of the result."""


def recovered_of(track: Track, i: int) -> float | None:
    """Return the percentage of the fault-induced tracking error avoided by using estimates."""
    return recovered(track.tracking, "estimated")


def recovered_told_of(track: Track, i: int) -> float | None:
    """Return the percentage of the fault-induced tracking error avoided with true parameters."""
    return recovered(track.tracking, "told")


def recovered(tracking: Mapping[str, float] | None, loop: str) -> float | None:
    """Return the avoided tracking error 100 (frozen − loop)/(frozen − without_fault) [%].

    The function returns None if the fault increases the tracking error by less than `COSTS`.

    Examples
    --------
    >>> recovered({"without_fault": 1.0, "frozen": 2.0, "estimated": 1.5}, "estimated")
    50.0
    >>> recovered({"without_fault": 1.0, "frozen": 1.1, "estimated": 1.0}, "estimated")
    """
    if tracking is None:
        return None
    best, worst = tracking["without_fault"], tracking["frozen"]
    if worst < (1 + COSTS) * best:
        return None
    return finite(100 * (worst - tracking[loop]) / (worst - best))


class TrueParameters:
    """An estimator that returns the true parameters of the next sample."""

    output = "speed"

    def __init__(self, scenario: Scenario) -> None:
        self.names, truth = scenario.parameter_names, scenario.true_parameters()
        self._next: Iterator[Array] = iter([*truth[1:], truth[-1]])

    def step(self, u: float, y: float) -> Array:
        """Return the true parameters of the next sample."""
        return next(self._next)


def tracking(scenario: Scenario, seed: int, estimator: Any) -> Mapping[str, float] | None:
    """Return the rms tracking errors of the motor in the window after the first fault.

    Parameters
    ----------
    scenario : Scenario
        Scenario before its random onset is drawn.
    seed : int
        Random seed of the fault onset and of the noise.
    estimator : Estimator
        Estimator that provides the controller parameters, in its initial state.

    Returns
    -------
    mapping of str to float, or None
        ``frozen``, ``told`` and ``estimated`` are the rms tracking errors with the fault, for a
        controller that uses the nominal, true or estimated parameters, respectively [rad].
        ``without_fault`` is the rms tracking error without the fault [rad]. ``limited`` is the
        number of samples at which the feed-forward limited a parameter estimate. The function
        returns None if the scenario has no adaptive feed-forward or no fault.
    """
    if scenario.controller.adapt is None or not scenario.fault:
        return None
    drawn = scenario.drawn(seed)
    rms, limited = _tracking_rms(scenario, [drawn], seed, [estimator])
    return {**_baselines(scenario, seed), "estimated": rms[0], "limited": float(limited[0])}


@remembered
def _baselines(scenario: Scenario, seed: int) -> Mapping[str, float]:
    """Return all rms tracking errors that do not depend on the estimator."""
    drawn = scenario.drawn(seed)
    healthy = drawn.override({"fault": []}, inherit=True)
    runs, followers = [drawn, drawn, healthy], [None, TrueParameters(drawn), None]
    rms, _ = _tracking_rms(scenario, runs, seed, followers)
    return dict(zip(("frozen", "told", "without_fault"), rms, strict=True))


def _tracking_rms(
    scenario: Scenario, runs: Sequence[Scenario], seed: int, followers: Sequence[Any]
) -> tuple[list[float], Any]:
    first = windows(runs[0], runs[0].identify)[0]
    error, limited = tracked(scenario, runs, seed, followers, samples=first.stop)
    rms = np.sqrt(np.mean(error[first.start : first.stop] ** 2, axis=0))
    return rms.tolist(), limited
