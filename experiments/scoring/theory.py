"""A case beside its theory: bounds, score, excess error, consistency of the claim, detection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.bounds import (
    jump_bound,
    lag_bound,
    noise_variance,
)
from flexaxis.experiments.scoring.case import Track, finite, lag_of
from flexaxis.experiments.scoring.described import describes, tracked, with_structure
from flexaxis.experiments.scoring.theta import physical, started_theta, theta_over_time
from flexaxis.experiments.scoring.windows import Window, windows
from flexaxis.sim.faults import Step
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

RMSE_AT = (20, 50, 100, 200, 400, 1000)  # samples after onset


@dataclass(frozen=True)
class Limits:
    """What theory says of one parameter in one case; None is "not defined here".

    Attributes
    ----------
    lag_null : float or None
        Lag of an estimator that never moves [s].
    lag_bound : float or None
        Lag on the oracle Cramér–Rao bound, all estimated parameters unknown [s].
    lag_bound_single : float or None
        The same for whoever knows that this parameter alone has changed [s].
    bound : dict of str to float
        The first bound on the standard deviation of θ̂ over D, by samples after onset.
    """

    lag_null: float | None = None
    lag_bound: float | None = None
    lag_bound_single: float | None = None
    bound: dict[str, float] | None = None


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


def limits(scenario: Scenario, names: Sequence[str], torque: Array) -> list[Limits]:
    """Return the limits of each estimated parameter, none of them where `bounded` has none."""
    spans = bounded(scenario, names)
    unknown = tracked(scenario, names)
    found = []
    for i, name in enumerate(names):
        if name not in spans:
            found.append(Limits())
            continue
        window = spans[name]
        allowed = jump_bound(scenario, unknown, window.start, window.stop, torque)
        deviation, single = allowed.unknown[:, i], allowed.single[:, i]
        found.append(
            Limits(
                lag_null=_lag_null(scenario, names, i, window),
                lag_bound=lag_bound(deviation, window.D, period=scenario.period),
                lag_bound_single=lag_bound(single, window.D, period=scenario.period),
                bound={str(n): float(deviation[n] / window.D) for n in RMSE_AT if n < len(single)},
            )
        )
    return found


def lag_bound_with_structure(scenario: Scenario, name: str, torque: Array) -> float | None:
    """Return the lag on the bound of whoever takes the structure for unknown besides [s].

    That is whatever `flexaxis.experiments.scoring.described.with_structure` names, all of it
    unknown after the jump, as if nothing had been learnt before; None where `bounded` has none.
    """
    window = bounded(scenario, scenario.identify).get(name)
    if window is None:
        return None
    unknown = with_structure(scenario, tracked(scenario, scenario.identify))
    allowed = jump_bound(scenario, unknown, window.start, window.stop, torque).unknown
    return lag_bound(allowed[:, unknown.index(name)], window.D, period=scenario.period)


def bounded(scenario: Scenario, names: Sequence[str]) -> dict[str, Window]:
    """Return the estimated parameters for which a bound is defined, with the window it is for.

    The bound is that of a single step on an axis that a model describes, whether or not estimators
    know how, and on which nothing else changes but by steps; the excitation must be on when it
    comes, and there must be noise, for without it nothing is unknown.
    """
    if scenario.nuisance or not describes(scenario) or not noise_variance(scenario) > 0:
        return {}
    if not all(isinstance(fault, Step) for fault in scenario.fault):
        return {}
    onsets = {event.parameter: event.index for event in scenario.events()}
    spans = windows(scenario, names)
    found = {}
    for name in names:
        mine = [w for w in spans if w.parameter == physical(name)[0]]
        if len(mine) == 1 and onsets[mine[0].parameter] == mine[0].start < mine[0].stop:
            found[name] = mine[0]
    return found


def _lag_null(scenario: Scenario, names: Sequence[str], i: int, window: Window) -> float | None:
    start = started_theta(scenario, names)[i]
    truth = theta_over_time(scenario, names)[window.start : window.stop, i]
    return finite(scenario.period * np.sum(np.abs(start - truth)) / window.D)


def score(lag: float | None, limit: Limits) -> float | None:
    """Return 100 ln(lag_null/lag)/ln(lag_null/lag_bound): 0 for doing nothing, 100 on the bound."""
    null, bound = limit.lag_null, limit.lag_bound
    if not lag or not null or not bound or bound >= null:
        return None
    if np.isclose(lag, null, rtol=1e-12, atol=0.0):  # but for rounding, it has done nothing
        return 0.0
    return float(100 * np.log(null / lag) / np.log(null / bound))


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
    if "limits" not in track.memo:
        track.memo["limits"] = limits(track.scenario, asked, track.torque)
    return track.memo["limits"][asked.index(track.names[i])]


def score_of(track: Track, i: int) -> float | None:
    """Return the score of the lag between doing nothing and the bound."""
    return score(lag_of(track, i), limits_of(track, i))


def nees_of(track: Track, i: int) -> float | None:
    """Return θ̃ᵀ Σ⁻¹ θ̃ at the last sample before the first fault, or of the run."""
    del i
    events = track.scenario.events()
    last = (events[0].index if events else track.scenario.samples) - 1
    return nees(track.theta[last] - track.truth[last], track.claimed)


def detection_of(track: Track, i: int) -> dict[str, Any] | None:
    """Return what the findings are worth, the same for all parameters of a case."""
    del i
    found = detection(track.scenario, track.names, track.findings)
    return None if found is None else asdict(found)


def isolation_of(track: Track, i: int) -> list[dict[str, Any]] | None:
    """Return what each fault was taken for, the same for all parameters of a case."""
    del i
    return isolation(track.scenario, track.names, track.findings)
