"""
What theory allows after a jump: the Cramér–Rao bound, the lag on it, and the score.

docs/scores.md has the formulas with their sources. All of them take the gradient ψ of the predictor
along the true parameters, and a white output noise of variance σ².
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.signals import SIGNALS
from flexaxis.experiments.scoring.parameter_names import physical, started_theta, theta_over_time
from flexaxis.experiments.scoring.scores import Track, finite, lag_of
from flexaxis.experiments.scoring.true_model import (
    describes,
    jump_gradient,
    model_theta,
    sizes,
    state_at,
    tracked,
    true_model,
)
from flexaxis.experiments.scoring.windows import Known, Window, windows
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.tables.faults import Step

Array = NDArray[np.float64]

PRIOR = 0.5  # standard deviation of θ after a jump, relative to θ, before anything is measured


def cramer_rao(psi: ArrayLike, variance: float, theta: ArrayLike) -> Array:
    """
    Return the bound C(n) (N, p, p) on the covariance of θ̂, n samples after a jump.

    C(n) = σ² [P_b⁻¹ + Σ_{k≤n} ψ₀ψ₀ᵀ]⁻¹ with P_b = diag((θ/2)²)/σ², for an estimator that knows
    time and state of the jump.

    Parameters
    ----------
    psi : (N, p) array_like
        ψ₀.
    variance : float
        σ² of the output noise.
    theta : (p,) array_like
        Parameters after the jump.
    """
    psi = np.asarray(psi, float)
    prior = np.diag(variance / (PRIOR * np.asarray(theta, float)) ** 2)
    return variance * np.linalg.inv(prior + np.cumsum(psi[:, :, None] * psi[:, None, :], axis=0))


def lag_bound(deviation: ArrayLike, size: float, *, period: float) -> float:
    """
    Return the lag [s] of an estimator on the bound, Σ T min(1, √(2/π) s_n/D).

    Parameters
    ----------
    deviation : (N,) array_like
        Standard deviations s_n by the bound.
    size : float
        D, size of the jump.
    """
    relative = np.sqrt(2 / np.pi) * np.asarray(deviation, float) / size
    return period * float(np.minimum(1.0, relative).sum())


@dataclass(frozen=True)
class JumpBound:
    """
    Bounds on the standard deviation of θ̂ after an event, each (n, p), from its sample on.

    Attributes
    ----------
    unknown : ndarray (n, p)
        For whoever takes all estimated parameters for unknown after the jump.
    single : ndarray (n, p)
        For whoever knows that this parameter alone has changed, and all others exactly.
    """

    unknown: Array
    single: Array


def jump_bound(
    scenario: Scenario, names: Sequence[str], index: int, stop: int, u: ArrayLike
) -> JumpBound:
    """
    Return the bounds on the standard deviation of θ̂ after an event of a scenario.

    Parameters
    ----------
    scenario : Scenario
        Such as `flexaxis.experiments.scoring.true_model.describes`, and with noise.
    names : sequence of str
        Parameters that are unknown after it.
    index, stop : int
        Samples from the event on, to this one.
    u : (N,) array_like
        Torque of a record of the scenario.
    """
    truth = scenario.true_parameters()
    u = np.asarray(u, float)
    x, variance = state_at(scenario, truth, u, index), noise_variance(scenario)
    return bound_from(scenario, names, truth[index], x, u[index:stop], variance=variance)


def bound_from(
    scenario: Scenario,
    names: Sequence[str],
    parameters: Array,
    x: Array,
    u: Array,
    *,
    variance: float,
) -> JumpBound:
    """
    Return the same from parameters after a jump (q,) and the state at it on.

    Parameters
    ----------
    scenario : Scenario
        Laws of the axis.
    names : sequence of str
    parameters : (q,) ndarray
        As of `Scenario.parameter_names`.
    x : (n,) ndarray
        Bristles may be left out: they forget in milliseconds.
    u : (N,) ndarray
        Torque from the jump on.
    variance : float
        σ² of the output noise.
    """
    model = true_model(scenario, parameters).parametrize(names)
    theta = model_theta(scenario, names, parameters)
    state = np.zeros(model.states)
    state[: len(x)] = x
    psi = jump_gradient(model, theta, u, state, period=scenario.period)
    # A friction that has fallen to zero gives the prior no scale; its nominal value does.
    scale = sizes(scenario, names, theta)
    bound = cramer_rao(psi, variance, scale)
    alone = [cramer_rao(psi[:, [i]], variance, scale[[i]])[:, 0, 0] for i in range(len(names))]
    return JumpBound(
        unknown=np.sqrt(np.diagonal(bound, axis1=1, axis2=2)),
        single=np.sqrt(np.column_stack(alone)),
    )


def noise_variance(scenario: Scenario) -> float:
    """Return σ² of what estimators read; of an increment, that of the encoder and its noise."""
    counts = scenario.encoder.counts
    step = 2 * np.pi / counts if counts else 0.0
    angle = scenario.noise.angle**2 + step**2 / 12
    return SIGNALS[scenario.output].noise(scenario.noise.speed**2, angle, scenario.period)


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
    per_parameter = []
    for i, name in enumerate(names):
        if name not in spans:
            per_parameter.append(Limits())
            continue
        window = spans[name]
        allowed = jump_bound(scenario, unknown, window.start, window.stop, torque)
        deviation, single = allowed.unknown[:, i], allowed.single[:, i]
        null = _lag_null(scenario, names, i, window)
        if not np.isfinite([deviation, single]).all():
            per_parameter.append(Limits(lag_null=null))
            continue
        per_parameter.append(
            Limits(
                lag_null=null,
                lag_bound=lag_bound(deviation, window.D, period=scenario.period),
                lag_bound_single=lag_bound(single, window.D, period=scenario.period),
                bound={str(n): float(deviation[n] / window.D) for n in RMSE_AT if n < len(single)},
            )
        )
    return per_parameter


def record_limits(scenario: Scenario, torque: Array) -> list[Limits]:
    """Return the limits of a scenario's `identify` on a record, kept for the next estimator."""
    torque = np.ascontiguousarray(torque, float)
    digest = f"{scenario.hash} {sha256(torque.tobytes()).hexdigest()}"
    return _remembered(Known(digest, (scenario, scenario.identify, torque)))


@lru_cache(maxsize=64)
def _remembered(record: Known) -> list[Limits]:
    return limits(*record.content)


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
    bounded_windows = {}
    for name in names:
        own = [w for w in spans if w.parameter == physical(name)[0]]
        if len(own) == 1 and onsets[own[0].parameter] == own[0].start < own[0].stop:
            bounded_windows[name] = own[0]
    return bounded_windows


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


# What follows are the scores themselves: of a track and the index of an estimated parameter.


def limits_of(track: Track, i: int) -> Limits:
    """Return the limits of one estimated parameter.

    They assume that the scenario's `identify` is unknown, for all estimators alike, even if an
    estimator estimates more or fewer parameters.
    """
    asked = track.scenario.identify
    if track.torque is None or track.names[i] not in asked:
        return Limits()
    torque = track.torque
    all_limits = track.once("limits", lambda: record_limits(track.scenario, torque))
    return all_limits[asked.index(track.names[i])]


def score_of(track: Track, i: int) -> float | None:
    """Return the score of the lag between doing nothing and the bound."""
    return score(lag_of(track, i), limits_of(track, i))
