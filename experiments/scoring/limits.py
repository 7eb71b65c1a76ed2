"""What theory allows after a jump: the lag on the bound, of what nobody is told, and the score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.bounds import jump_bound, lag_bound, noise_variance
from flexaxis.experiments.scoring.case import finite
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


@dataclass(frozen=True)
class _Record:
    """A record, known by its scenario and torque: many estimators have the same limits on it."""

    hash: str
    digest: bytes
    scenario: Scenario = field(compare=False)
    torque: Array = field(compare=False)

    @classmethod
    def of(cls, scenario: Scenario, torque: Array) -> _Record:
        torque = np.ascontiguousarray(torque, float)
        return cls(scenario.hash, sha256(torque.tobytes()).digest(), scenario, torque)


@lru_cache(maxsize=64)
def _remembered(record: _Record) -> list[Limits]:
    return limits(record.scenario, record.scenario.identify, record.torque)


def record_limits(scenario: Scenario, torque: Array) -> list[Limits]:
    """Return the limits of a scenario's `identify` on a record, kept for the next estimator."""
    return _remembered(_Record.of(scenario, torque))


def lag_bound_with_structure(scenario: Scenario, name: str, torque: Array) -> float | None:
    """Return the lag on the bound of whoever takes the structure for unknown besides [s].

    That is whatever `flexaxis.experiments.scoring.described.with_structure` names, all of it
    unknown after the jump, as if nothing had been learnt before; None where `bounded` has none.
    """
    return _with_structure(_Record.of(scenario, torque), name)


@lru_cache(maxsize=256)
def _with_structure(record: _Record, name: str) -> float | None:
    scenario = record.scenario
    window = bounded(scenario, scenario.identify).get(name)
    if window is None:
        return None
    unknown = with_structure(scenario, tracked(scenario, scenario.identify))
    allowed = jump_bound(scenario, unknown, window.start, window.stop, record.torque).unknown
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
