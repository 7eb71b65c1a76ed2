"""What trajectories are drawn from: of one run in detail, and of all runs of an estimator pooled.

A whole run is kept at every tenth sample. What a fault does to an estimate happens in less than
that shows, so that the time about the first fault is kept sample by sample.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.parameter_names import nominal_theta, theta_over_time
from flexaxis.experiments.scoring.scores import Track
from flexaxis.experiments.scoring.windows import windows
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]
Single = NDArray[np.float32]

CURVE_STEP = 10  # samples from one kept point of a whole trajectory to the next
BEFORE, AFTER = 0.1, 1.0  # s about a fault in which every sample is kept
BAND = (10.0, 50.0, 90.0)  # percentiles of the trajectories


@dataclass(frozen=True, eq=False)
class Detail:
    """What is kept of one run besides its trajectory.

    Attributes
    ----------
    near : ndarray (W, p)
        Every estimate about the first fault (`near_fault`), over its nominal value; (0, p) where
        there is none.
    residual : ndarray (M,) or None
        Root mean square of ε = y − ŷ over the samples from one kept point to the next, in the unit
        of y; NaN where there was no y. None of an estimator that does not show it.
    findings : tuple of dict
        What the estimator said it found: ``time`` and ``onset`` [s], ``parameters``, and where it
        gives them ``ratio`` (new value over old, of each) and ``reason``.
    """

    near: Single
    residual: Single | None = None
    findings: tuple[Mapping[str, Any], ...] = ()


def near_fault(scenario: Scenario) -> slice:
    """Return the samples about the first scored fault that are all kept; none without a fault."""
    first = next(iter(windows(scenario, scenario.identify)), None)
    if first is None:
        return slice(0, 0)
    start = first.start - round(BEFORE / scenario.period)
    return slice(max(0, start), min(scenario.samples, first.start + after(scenario)))


def after(scenario: Scenario) -> int:
    """Return how many samples are kept from a fault on."""
    return round(AFTER / scenario.period) + 1


def later(drawn: Scenario, written: Scenario) -> int:
    """Return by how many samples the first fault of a run is later than it is written."""
    if not (drawn.events() and written.events()):
        return 0
    return drawn.events()[0].index - written.events()[0].index


def shifted(values: Array, late: int) -> Array:
    """Return values (N, …) some samples earlier; those at the ends stay there.

    Examples
    --------
    >>> shifted(np.arange(4.0), 1).tolist(), shifted(np.arange(4.0), -1).tolist()
    ([1.0, 2.0, 3.0, 3.0], [0.0, 0.0, 1.0, 2.0])
    """
    if not late:
        return values
    return values[np.clip(np.arange(len(values)) + late, 0, len(values) - 1)]


def detail_of(track: Track, late: int = 0) -> Detail:
    """Return what is kept of a track besides its trajectory, as if it were `late` earlier."""
    near = track.theta[near_fault(track.scenario)] / track.nominal
    innovations = track.innovations
    return Detail(
        near=near.astype(np.float32),
        residual=_shown(None if innovations is None else shifted(innovations, late)),
        findings=tuple(_told(f, track.scenario.period, late) for f in track.findings or ()),
    )


def _shown(innovations: Array | None) -> Single | None:
    if innovations is None or np.isnan(innovations[:, 0]).all():  # it predicts nothing
        return None
    return residual(innovations[:, 0])


def residual(epsilon: Array) -> Single:
    """Return the rms (M,) of ε (N,) over each step of a kept trajectory, NaN where there is none.

    Examples
    --------
    >>> residual(np.r_[np.full(10, 2.0), np.nan, 3.0, -3.0]).tolist()
    [2.0, 3.0]
    """
    starts = np.arange(0, len(epsilon), CURVE_STEP)
    there = np.isfinite(epsilon)
    squares = np.add.reduceat(np.where(there, epsilon, 0.0) ** 2, starts)
    count = np.add.reduceat(there, starts, dtype=int)
    found = np.sqrt(squares / np.maximum(count, 1))
    return np.where(count > 0, found, np.nan).astype(np.float32)


def _told(finding: Any, period: float, late: int) -> dict[str, Any]:
    """Return a finding as JSON; one of a user's need have no more than alarm and parameters."""
    ratio = [float(each) for each in getattr(finding, "ratio", None) or ()]
    return {
        "time": float((finding.alarm - late) * period),
        "onset": float((getattr(finding, "onset", finding.alarm) - late) * period),
        "parameters": [str(name) for name in finding.parameters],
        "ratio": [each if np.isfinite(each) else None for each in ratio],
        "reason": str(getattr(finding, "reason", "") or ""),
    }


@dataclass(frozen=True)
class Curve:
    """Trajectories of one estimator on one scenario, over all seeds, over nominal.

    `truth`, `low`, `median`, `high` are (M, p), `time` is (M,) [s]; low and high are the 10th and
    90th percentile. `near` is the same about the first fault, every sample of it; None where there
    is no fault, or where it was not kept.
    """

    scenario: str
    estimator: str
    names: tuple[str, ...]
    time: Array
    truth: Array
    low: Array
    median: Array
    high: Array
    near: Curve | None = None


def curve_of(
    scenario: Scenario,
    estimator: str,
    names: Sequence[str],
    runs: Sequence[Single],
    near: Sequence[Single] = (),
) -> Curve:
    """Return the trajectories of an estimator on a scenario.

    Parameters
    ----------
    scenario : Scenario
    estimator : str
        What to call it.
    names : sequence of str
        Estimated parameters.
    runs : sequence of ndarray (M, p)
        Every tenth estimate over its nominal value, of each run.
    near : sequence of ndarray (W, p)
        Every estimate about the first fault, where it was kept.
    """
    times = scenario.times
    truth = theta_over_time(scenario, names) / nominal_theta(scenario, names)
    made = partial(Curve, scenario.name, estimator, tuple(names))
    close, part = None, near_fault(scenario)
    if len(near) and near[0].size:
        close = made(times[part], truth[part], *_band(near))
    return made(times[::CURVE_STEP], truth[::CURVE_STEP], *_band(runs), near=close)


def _band(runs: Sequence[Single]) -> tuple[Array, Array, Array]:
    drawn = np.stack(runs).astype(float)
    with np.errstate(all="ignore"):  # a lost run may hold anything
        low, median, high = np.percentile(np.where(np.isnan(drawn), np.inf, drawn), BAND, axis=0)
    return low, median, high
