"""
Compute the Cramér–Rao bound after a parameter jump, the lag at this bound, and the lag score.

The page docs/scores.md contains the formulas and their sources. All formulas use the predictor
gradient ψ at the true parameters, and assume white output noise with variance σ². If estimators
read an encoder angle or angle increments, the output noise is the angle noise.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.scoring.parameter_names import physical, started_theta, theta_over_time
from flexaxis.experiments.scoring.scores import Track, finite, lag_of
from flexaxis.experiments.scoring.true_model import (
    PRIOR,
    describes,
    jump_gradient,
    model_theta,
    reads_encoder,
    sizes,
    state_at,
    tracked,
    true_model,
    untold,
)
from flexaxis.experiments.scoring.windows import Window, remembered, windows
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.tables.faults import Step

Array = NDArray[np.float64]

LIMITS = {
    "lag_null": "Lag of an estimator with constant estimates.",
    "lag_bound": "Lag at the Cramér–Rao bound, for an estimator that knows the time of the jump "
    "and the state at the jump. The estimator knows neither the estimated parameters nor the dry "
    "friction after the jump.",
    "lag_bound_single": "Lag at the Cramér–Rao bound, for an estimator that knows the time of the "
    "jump, the state at the jump, and all parameters that did not change.",
    "lag_bound_learnt": "Lag at the Cramér–Rao bound, for an estimator that knows some "
    "parameters only inexactly, and must also estimate them from the data before the fault.",
}
"""Descriptions of the theoretical limits on the lag [s]."""


def cramer_rao(
    psi: ArrayLike, variance: float, theta: ArrayLike, prior: ArrayLike | None = None
) -> Array:
    """
    Return the lower bound on the covariance of θ̂ at each sample after a jump, shape (N, p, p).

    After n samples, the bound is C(n) = σ² [P_b⁻¹ + Σ_{k≤n} ψ₀ψ₀ᵀ]⁻¹, where ψ₀ is the predictor
    gradient after the jump. P_b = diag((θ/2)²)/σ² is the initial covariance divided by σ². The
    bound is valid for an estimator that knows the time of the jump and the state at the jump.

    Parameters
    ----------
    psi : (N, p) array_like
        Predictor gradient ψ₀ after the jump.
    variance : float
        Variance σ² of the output noise.
    theta : (p,) array_like
        Parameters after the jump.
    prior : (p, p) array_like, optional
        Information matrix of the parameters at the time of the jump. The default is P_b⁻¹/σ².
    """
    psi = np.asarray(psi, float)
    if prior is None:
        known = np.diag(variance / (PRIOR * np.asarray(theta, float)) ** 2)
    else:
        known = variance * np.asarray(prior)
    return variance * np.linalg.inv(known + np.cumsum(psi[:, :, None] * psi[:, None, :], axis=0))


def lag_bound(deviation: ArrayLike, size: float, *, period: float) -> float:
    """
    Return the lag Σ T min(1, √(2/π) s_n/D) [s] of an estimator that attains the Cramér–Rao bound.

    Parameters
    ----------
    deviation : (N,) array_like
        Standard deviation s_n of an estimate that attains the bound, n samples after the jump.
    size : float
        Size D of the jump.
    period : float
        Sampling period T [s].
    """
    relative = np.sqrt(2 / np.pi) * np.asarray(deviation, float) / size
    return period * float(np.minimum(1.0, relative).sum())


class JumpBound(NamedTuple):
    """
    Lower bounds on the standard deviation of θ̂ at the n samples after an event.

    Attributes
    ----------
    unknown : ndarray (n, p)
        Bound for an estimator that knows none of the estimated parameters after the event.
    single : ndarray (n, p)
        Bound for each parameter if all other parameters are known after the event.
    learnt : ndarray (n, p)
        Bound for an estimator that knows none of the estimated parameters after the event. Before
        the event, the estimator must also estimate all parameters that it knows only inexactly
        (`true_model.untold`).
    """

    unknown: Array
    single: Array
    learnt: Array


def jump_bound(
    scenario: Scenario, names: Sequence[str], index: int, stop: int, u: ArrayLike
) -> JumpBound:
    """
    Return the bounds on the standard deviation of θ̂ after an event of a scenario.

    Parameters
    ----------
    scenario : Scenario
        Scenario with noise. One of the estimator models must describe the axis of the scenario
        (`flexaxis.experiments.scoring.true_model.describes`).
    names : sequence of str
        Names of the parameters that are unknown after the event.
    index, stop : int
        Index of the sample at which the event occurs, and index one past the last sample that has a
        bound.
    u : (N,) array_like
        Torque of a record of the scenario [N m].
    """
    truth, u = scenario.true_parameters(), np.asarray(u, float)
    x, variance = state_at(scenario, truth, u, index), noise_variance(scenario)
    result = bound_from(scenario, names, truth[index], x, u[index:stop], variance=variance)
    errors = dict.fromkeys(names, PRIOR) | untold(scenario, names)
    p, every = len(names), tuple(errors)
    if p == len(every):
        return result
    # Before the event, the data provide information about all parameters. After the event, this
    # information remains valid except for the parameters `names`, which may change at the event.
    before, size = _gradient(scenario, every, truth[0], np.zeros(0), u[:index])
    known = np.diag([error**-2 for error in errors.values()])
    learnt = np.linalg.inv(known + (before * size).T @ (before * size) / variance)
    known[p:, p:] = np.linalg.inv(learnt[p:, p:])
    after, size = _gradient(scenario, every, truth[index], x, u[index:stop])
    C = cramer_rao(after * size, variance, size, known)
    return result._replace(learnt=_deviation(C)[:, :p] * np.abs(size[:p]))


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
    Return the standard-deviation bounds after a jump, given the parameters and state at the jump.

    Parameters
    ----------
    scenario : Scenario
        Scenario that defines the friction and other nonlinear laws of the axis.
    names : sequence of str
        Names of the parameters that are unknown after the jump.
    parameters : (q,) ndarray
        Physical parameters after the jump, in the order of `Scenario.parameter_names`.
    x : (n,) ndarray
        State at the jump. The bristle states can be omitted, because they decay within
        milliseconds.
    u : (N,) ndarray
        Torque after the jump [N m].
    variance : float
        Variance σ² of the output noise.
    """
    psi, scale = _gradient(scenario, names, parameters, x, u)
    bound = cramer_rao(psi, variance, scale)
    alone = [cramer_rao(psi[:, [i]], variance, scale[[i]])[:, 0, 0] for i in range(len(names))]
    unknown = _deviation(bound)
    return JumpBound(unknown, np.sqrt(np.column_stack(alone)), unknown)


def _deviation(covariance: Array) -> Array:
    """Return the standard deviations (n, p) from the covariance matrices (n, p, p)."""
    return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))


def _gradient(
    scenario: Scenario, names: Sequence[str], parameters: Array, x: Array, u: Array
) -> tuple[Array, Array]:
    """Return the predictor gradient ψ₀ (N, p) from the state x, and the parameter scales (p,)."""
    model = true_model(scenario, parameters).parametrize(names)
    theta = model_theta(scenario, names, parameters)
    state = np.zeros(model.states)
    state[: len(x)] = x
    psi = jump_gradient(model, theta, u, state, period=scenario.period)
    # The scale of the prior is the parameter, or its initial value if friction has become zero.
    return psi, sizes(scenario, names, theta)


def noise_variance(scenario: Scenario) -> float:
    """Return the variance of the speed noise, or of the angle noise if an encoder is read."""
    if not reads_encoder(scenario):
        return scenario.noise.speed**2
    counts = scenario.encoder.counts
    step = 2 * np.pi / counts if counts else 0.0
    return scenario.noise.angle**2 + step**2 / 12


Limits = Mapping[str, float | None]
"""Lag limits of a parameter in one run, keyed as in `LIMITS`; an undefined limit is None."""


def limits(scenario: Scenario, names: Sequence[str], torque: Array) -> dict[str, Limits]:
    """
    Return the theoretical limits on the lag of each parameter that has a bound.

    Parameters
    ----------
    scenario : Scenario
        Scenario of the record.
    names : sequence of str
        Names of the estimated parameters.
    torque : (N,) ndarray
        Torque of the record [N m].

    Returns
    -------
    dict of str to mapping
        Theoretical limits on the lag [s], keyed by parameter. The limits of a parameter have the
        same keys as `LIMITS`.
    """
    unknown, result = tracked(scenario, names), dict[str, Limits]()
    for name, window in bounded(scenario, names).items():
        i = names.index(name)
        allowed = jump_bound(scenario, unknown, window.start, window.stop, torque)
        lags = [finite(lag_bound(x[:, i], window.D, period=scenario.period)) for x in allowed]
        result[name] = dict(zip(LIMITS, [_lag_null(scenario, name, window), *lags], strict=True))
    return result


@remembered
def record_limits(scenario: Scenario, torque: bytes) -> dict[str, Limits]:
    """Return the lag limits of all identified parameters; all estimators share the cache."""
    return limits(scenario, scenario.identify, np.frombuffer(torque).copy())


def bounded(scenario: Scenario, names: Sequence[str]) -> dict[str, Window]:
    """Return the scoring windows of the parameters for which a bound is defined, keyed by name.

    A parameter has a bound only if its value changes exactly once, in a step, while the excitation
    is on. All other faults must also be steps, and no parameter may change without a fault. One of
    the estimator models must describe the axis, even if no estimator uses this model. The scenario
    must have noise, because all bounds are zero without noise.
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


def _lag_null(scenario: Scenario, name: str, window: Window) -> float | None:
    start = started_theta(scenario, [name])
    truth = theta_over_time(scenario, [name])[window.start : window.stop]
    return finite(scenario.period * np.sum(np.abs(start - truth)) / window.D)


def score(lag: float | None, limit: Limits) -> float | None:
    """Return the score 100 ln(lag_null/lag)/ln(lag_null/lag_bound), which is 0 if θ̂ is constant."""
    null, bound = limit.get("lag_null"), limit.get("lag_bound")
    if not lag or not null or not bound or bound >= null:
        return None
    if np.isclose(lag, null, rtol=1e-12, atol=0.0):  # equal up to rounding
        return 0.0
    return float(100 * np.log(null / lag) / np.log(null / bound))


# Scores: functions of a track and the index of an estimated parameter.


def limits_of(track: Track, i: int) -> Limits:
    """Return the theoretical limits on the lag of the estimated parameter i.

    The function computes the limits for all parameters that the scenario identifies, even if the
    estimator estimates other parameters. Therefore the limits are the same for all estimators.
    """
    if track.torque is None:
        return {}
    torque = np.asarray(track.torque, float).tobytes()
    return record_limits(track.scenario, torque).get(track.names[i], {})


def limit_of(name: str, track: Track, i: int) -> float | None:
    """Return the lag limit `name`, such as "lag_bound", of the estimated parameter i."""
    return limits_of(track, i).get(name)


def score_of(track: Track, i: int) -> float | None:
    """Return the lag on a logarithmic scale: 0 for constant estimates, 100 at the lag bound."""
    return score(lag_of(track, i), limits_of(track, i))
