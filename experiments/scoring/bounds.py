"""
What theory allows: Cramér–Rao after a jump.

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
