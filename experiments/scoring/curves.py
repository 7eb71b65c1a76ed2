"""What trajectories are drawn from: a run in detail, and the runs of an estimator as a table.

A whole run is kept at every tenth sample. What a fault does to an estimate happens in less than
that shows, so that the time about the first fault is kept sample by sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.experiments.scoring.parameter_names import nominal_theta, theta_over_time
from flexaxis.experiments.scoring.scores import Track
from flexaxis.experiments.scoring.windows import windows
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]
Single = NDArray[np.float32]

CURVE_STEP = 10  # samples from one kept point of a whole trajectory to the next
BEFORE, AFTER = 0.1, 1.0  # s about a fault in which every sample is kept


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


def estimates(traces: Mapping[int, Any], scenario: Scenario, parameter: str) -> pd.DataFrame:
    """Return estimates over nominal: a line a time [s], a column a seed.

    Around the first fault every sample is there, else one in `CURVE_STEP`.
    """
    times = np.r_[scenario.times[::CURVE_STEP], scenario.times[near_fault(scenario)]]
    runs = {seed: np.r_[trace.curve, trace.detail.near][:, trace.names.index(parameter)]
            for seed, trace in traces.items()}  # fmt: skip
    table = pd.DataFrame(runs, index=times, dtype=float)
    return table[~table.index.duplicated()].sort_index()


def truth(scenario: Scenario, parameter: str) -> pd.Series:
    """Return the true values of a parameter over nominal, over time [s]."""
    values = theta_over_time(scenario, [parameter]) / nominal_theta(scenario, [parameter])
    return pd.Series(values[:, 0], scenario.times)
