"""A case beside its theory: limits, score, consistency of the claim, detection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.case import Track, finite, lag_of
from flexaxis.experiments.scoring.limits import Limits, record_limits, score
from flexaxis.experiments.scoring.theta import physical
from flexaxis.experiments.scoring.windows import Window, claimed_at, windows
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Detection:
    """What the findings of an estimator are worth in one case.

    Attributes
    ----------
    alarms : int
        All findings.
    false_alarms : int
        Findings outside the windows of all faults.
    false_alarms_per_1000_s : float
        The same over the time outside these windows.
    delay : float or None
        From a fault to the first finding in its window, mean over those detected [s].
    faults, missed : int
        Faults, and those without a finding in their window.
    isolated : float or None
        Share of the faults detected whose first finding ends up naming what changed, and no more.
    """

    alarms: int
    false_alarms: int
    false_alarms_per_1000_s: float
    delay: float | None
    faults: int
    missed: int
    isolated: float | None


ALARMS = tuple(Detection.__dataclass_fields__)


def nees(error: Array, covariance: Any) -> float | None:
    """Return θ̃ᵀ Σ⁻¹ θ̃, which for an honest Σ is χ² with p degrees of freedom on average p.

    Parameters
    ----------
    error : ndarray (p,)
        θ̃.
    covariance : array_like (p, p) or None
        Σ, as claimed.
    """
    if covariance is None:
        return None
    scale = np.sqrt(np.abs(np.diag(np.asarray(covariance, float))))
    if not (np.isfinite(error).all() and np.all(scale > 0)):
        return None
    try:
        scaled = error / scale
        return finite(float(scaled @ np.linalg.solve(covariance / np.outer(scale, scale), scaled)))
    except np.linalg.LinAlgError:
        return None


def detection(
    scenario: Scenario, names: Sequence[str], findings: Sequence[Any] | None
) -> Detection | None:
    """Score the findings of an estimator; None for one that has none to give.

    Parameters
    ----------
    scenario : Scenario
    names : sequence of str
        Estimated parameters.
    findings : sequence, optional
        Each with ``alarm`` (sample) and ``parameters`` (names).
    """
    if findings is None:
        return None
    spans = windows(scenario, names)
    alarms = np.array([finding.alarm for finding in findings], int)
    inside = np.zeros(len(alarms), bool)
    delays, named = [], []
    for window in spans:
        within = (alarms >= window.start) & (alarms < window.stop)
        inside |= within
        if within.any():
            first = findings[int(np.argmax(within))]
            delays.append(scenario.period * (first.alarm - window.start))
            changed = {w.parameter for w in spans if w.start == window.start}
            named.append({physical(name)[0] for name in first.parameters} == changed)
    return Detection(
        alarms=len(alarms),
        false_alarms=int(np.sum(~inside)),
        false_alarms_per_1000_s=1000 * float(np.sum(~inside)) / _calm(scenario, spans),
        delay=float(np.mean(delays)) if delays else None,
        faults=len(spans),
        missed=len(spans) - len(delays),
        isolated=float(np.mean(named)) if named else None,
    )


def _calm(scenario: Scenario, spans: Sequence[Window]) -> float:
    """Return the time in which an alarm is a false one [s]: all but the windows."""
    calm = np.ones(scenario.samples, bool)
    for window in spans:
        calm[window.start : window.stop] = False
    return max(1, int(calm.sum())) * scenario.period


def isolation(
    scenario: Scenario, names: Sequence[str], findings: Sequence[Any] | None
) -> list[dict[str, Any]] | None:
    """Return what each fault was taken for; None for an estimator without findings.

    Returns
    -------
    list of dict
        A dict a fault: ``fault``, the parameter that changed, and ``named``, the physical
        parameters of the first finding in its window: [] for an unmodelled change, None for a
        fault that was missed.
    """
    if findings is None:
        return None
    found = []
    for window in windows(scenario, names):
        inside = [f for f in findings if window.start <= f.alarm < window.stop]
        named = [physical(name)[0] for name in inside[0].parameters] if inside else None
        found.append({"fault": window.parameter, "named": named})
    return found


# What follows are the scores themselves: of a track and the index of an estimated parameter.


def limits_of(track: Track, i: int) -> Limits:
    """Return the limits of one estimated parameter.

    They are those of the scenario's `identify`, the same for all estimators: whoever takes more or
    fewer parameters for unknown is measured by the same bound.
    """
    asked = track.scenario.identify
    if track.torque is None or track.names[i] not in asked:
        return Limits()
    torque = track.torque
    found = track.once("limits", lambda: record_limits(track.scenario, torque))
    return found[asked.index(track.names[i])]


def score_of(track: Track, i: int) -> float | None:
    """Return the score of the lag between doing nothing and the bound."""
    return score(lag_of(track, i), limits_of(track, i))


def nees_of(track: Track, i: int) -> float | None:
    """Return θ̃ᵀ Σ⁻¹ θ̃ where it is asked what is claimed, before the first fault."""
    del i
    last = claimed_at(track.scenario)
    return track.once("nees", lambda: nees(track.theta[last] - track.truth[last], track.claimed))


def detection_of(track: Track, i: int) -> dict[str, Any] | None:
    """Return what the findings are worth, the same for all parameters of a case."""
    del i
    found = track.once("detection", lambda: detection(track.scenario, track.names, track.findings))
    return None if found is None else asdict(found)


def isolation_of(track: Track, i: int) -> list[dict[str, Any]] | None:
    """Return what each fault was taken for, the same for all parameters of a case."""
    del i
    return track.once("isolation", lambda: isolation(track.scenario, track.names, track.findings))
