"""
What theory allows: Cramér–Rao after a jump, the theory of tracking, a posterior bound.

docs/scores.md has the formulas with their sources. All of them take the gradient ψ of the predictor
along the true parameters, and a white output noise of variance σ².
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.scoring.described import model_theta, sizes, true_model
from flexaxis.experiments.scoring.true_path import jump_gradient, state_at
from flexaxis.sim.scenario import Scenario

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
        Such as `flexaxis.experiments.scoring.described.describes`, and with noise.
    names : sequence of str
        Parameters that are unknown after it.
    index, stop : int
        Samples from the event on, to this one.
    u : (N,) array_like
        Torque of a record of the scenario.
    """
    truth = scenario.true_parameters()
    u = np.asarray(u, float)
    x = state_at(scenario, truth, u, index)
    model = true_model(scenario, truth[index]).parametrize(names)
    theta = model_theta(scenario, names, truth[index])
    psi = jump_gradient(model, theta, u[index:stop], x, period=scenario.period)
    # A friction that has fallen to zero gives the prior no scale; its nominal value does.
    scale = sizes(scenario, names, theta)
    variance = noise_variance(scenario)
    bound = cramer_rao(psi, variance, scale)
    alone = [cramer_rao(psi[:, [i]], variance, scale[[i]])[:, 0, 0] for i in range(len(names))]
    return JumpBound(
        unknown=np.sqrt(np.diagonal(bound, axis1=1, axis2=2)),
        single=np.sqrt(np.column_stack(alone)),
    )


def noise_variance(scenario: Scenario) -> float:
    """Return σ² of what estimators read; of an increment, that of the encoder and its noise."""
    if scenario.output == "speed":
        return scenario.noise.speed**2
    counts = scenario.encoder.counts
    step = 2 * np.pi / counts if counts else 0.0
    return 2 * (scenario.noise.angle**2 + step**2 / 12) / scenario.period**2


def tracking_covariance(
    Q: ArrayLike, variance: float, *, forgetting: float, walk: ArrayLike
) -> Array:
    """
    Return the covariance Π (p, p) of θ̂ − θ with forgetting, for θ a random walk.

    Π = ½ [ν σ² Q⁻¹ + W/ν], ν = 1−λ: noise let in, and change not followed. For slow adaptation.

    Parameters
    ----------
    Q : (p, p) array_like
        E ψψᵀ.
    variance : float
        σ².
    forgetting : float
        λ.
    walk : (p, p) array_like
        W, covariance that θ gains in a sample.
    """
    nu = 1 - forgetting
    return (nu * variance * np.linalg.inv(np.asarray(Q, float)) + np.asarray(walk) / nu) / 2


def drift_tracking_variance(
    Q: ArrayLike, variance: float, *, P: ArrayLike, walk: ArrayLike
) -> Array:
    """
    Return the variances Π_ii (p,) with covariance modification: σ² P_ii/2 + W_ii/(2 P_ii Q_ii).

    Parameters
    ----------
    Q, variance, walk
        As for `tracking_covariance`.
    P : (p, p) array_like
        Steady state, as from `flexaxis.estimators.offline.adaptation.steady_P`.
    """
    P_ii, Q_ii = np.diag(np.asarray(P)), np.diag(np.asarray(Q))
    return variance * P_ii / 2 + np.diag(np.asarray(walk)) / (2 * P_ii * Q_ii)


def posterior_bound(psi: ArrayLike, variance: float, *, walk: ArrayLike, start: ArrayLike) -> Array:
    """
    Return the bound (N, p, p) on the covariance of any estimate of a random walk.

    J ← (W + J⁻¹)⁻¹ + ψψᵀ/σ², and J⁻¹ is the bound.

    Parameters
    ----------
    psi : (N, p) array_like
        Gradient along the true path.
    variance : float
        σ².
    walk : (p, p) array_like
        W.
    start : (p, p) array_like
        Covariance before the first sample.
    """
    J, W = np.linalg.inv(np.asarray(start, float)), np.asarray(walk, float)
    bounds = np.empty((len(np.asarray(psi)), *W.shape))
    for k, row in enumerate(np.asarray(psi, float)):
        J = np.linalg.inv(W + np.linalg.inv(J)) + np.outer(row, row) / variance
        bounds[k] = np.linalg.inv(J)
    return bounds


def validity(time_constants: ArrayLike, poles: ArrayLike, *, period: float) -> float:
    """
    Return how much slower the adaptation is than the memory of the plant; below 1, mistrust.

    min τ_i T · min |Re pole|: the theory takes the gradient for that of constant parameters.

    Parameters
    ----------
    time_constants : (p,) array_like
        τ_i of the estimates [samples].
    poles : (n,) array_like
        Poles of the plant [1/s]; one at the origin is left out.
    """
    damping = np.abs(np.real(np.asarray(poles)))
    return float(np.min(time_constants) * period * damping[damping > 1e-9].min())
