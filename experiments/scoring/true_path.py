"""The true path of an axis: its state at a sample, and from there the gradient of the output."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.sampling.compiler import compiled
from flexaxis.estimators.sampling.extended import sampled_system
from flexaxis.estimators.sampling.plan import law_plan
from flexaxis.estimators.sampling.prepared import Prepared, copy, prepare, travel
from flexaxis.estimators.sampling.sampled import terms
from flexaxis.experiments.scoring.described import true_model
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

FINER = 2  # times the steps that estimators take with laws: 3 % of a bound then, as the tests show;
# with Coulomb friction, which is as good as a jump, up to 7 % of a lag bound (beside 16 times)


def jump_gradient(
    model: Parametrization,
    theta: ArrayLike,
    u: ArrayLike,
    x: ArrayLike,
    *,
    period: float,
) -> Array:
    """
    Return the gradient ψ₀ (N, p) at the N samples from a jump on.

    The state at the jump does not depend on the new θ, so the sensitivities start at zero there:
    information comes slower than in steady state, where ψ remembers the past.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array_like
        Parameters after the jump.
    u : (N,) array_like
        Torque from the jump on.
    x : (n,) array_like
        State at the jump, those of laws included.
    period : float
        Sampling period T [s].
    """
    u = np.ascontiguousarray(u, float)
    if model.laws is not None:
        prepared = _prepared(model, np.asarray(theta, float), range(len(model.names)), period)
        return _travelled(prepared, _start(model, x, len(model.names)), u)[0]
    transition, gain, output = sampled_system(model, theta, period)
    X = np.zeros(len(transition))
    X[-model.n :] = x
    return _driven(transition, gain, X, u)[:-1] @ output[:-1].T


@compiled
def _driven(transition, gain, x, u):
    """Return the states (N+1, n) that u takes x to."""
    states = np.empty((len(u) + 1, len(x)))
    for i in range(len(x)):
        states[0, i] = x[i]
    for k in range(len(u)):
        moved = np.dot(transition, states[k])
        for i in range(len(x)):
            states[k + 1, i] = moved[i] + gain[i] * u[k]
    return states


@compiled
def _travelled(prepared, X, u):
    """Return ψ (N, q), zero at first, and states and sensitivities after N samples; X is lost."""
    gradient, moved = np.zeros((len(u), len(X) - 1)), np.zeros_like(X)
    for k in range(len(u)):
        for a in range(1, len(X) if k > 0 else 1):
            gradient[k, a - 1] = X[a, X.shape[1] - 1]
        travel(prepared, X, moved, u[k])
        copy(moved, X)
    return gradient, X


def _prepared(model: Parametrization, theta: Array, active: range, period: float) -> Prepared:
    steps, order, substeps = law_plan(model, theta, theta, period)
    steps *= FINER
    parts = terms(model, order, substeps, period / steps, steps=steps)
    return prepare(parts, theta, np.array(active, np.int64))


def _start(model: Parametrization, x: ArrayLike, q: int) -> Array:
    """Return states and sensitivities [x; y] at a sample: no state depends on θ yet."""
    X = np.zeros((1 + q, model.n + 1))
    X[0, : model.states] = x
    return X


def state_at(scenario: Scenario, truth: Array, u: Array, index: int) -> Array:
    """Return the true state (n,) at a sample, through every change before it.

    That of the model from rest, for its own parameters (N, P) and the torque (N,) of a record.
    """
    edges = [0, *(np.flatnonzero((np.diff(truth[:index], axis=0) != 0).any(axis=1)) + 1), index]
    x = np.zeros(true_model(scenario, truth[0]).parametrize(["k_T"]).states)
    for first, last in pairwise(edges):
        model = true_model(scenario, truth[first]).parametrize(["k_T"])
        x = _after(model, u[first:last], x, scenario.period)
    return x


def _after(model: Parametrization, u: Array, x: Array, period: float) -> Array:
    """Return the state (n,) to which a torque (N,) takes a model."""
    if model.laws is not None:
        X = _start(model, x, 0)
        prepared = _prepared(model, model.theta, range(0), period)
        return _travelled(prepared, X, np.ascontiguousarray(u))[1][0, : model.states]
    transition, gain, _ = sampled_system(model, model.theta, period)
    A, b = transition[model.n :, model.n :].copy(), gain[model.n :].copy()
    return _driven(A, b, x, u)[-1]
