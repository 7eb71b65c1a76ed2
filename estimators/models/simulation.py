"""A model at fixed parameters along a torque, with its sensitivities; filters do the same."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.compiler import loop
from flexaxis.estimators.models.discretisation import plan
from flexaxis.estimators.models.memory import Matrix, Memory, Vector, views
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.models.rows import copy, padded
from flexaxis.estimators.models.series import LAWS, Axis, axis_arrays, over_sample

Array = NDArray[np.float64]

LEAST = 1e-300  # replaces a zero of a parameter of the linear model


class Simulation(NamedTuple):
    """The model, θ (p,), and X (n+1, lanes): states and, last, output, with their derivatives."""

    axis: Axis
    theta: Vector
    X: Matrix


def simulation(
    model: Parametrization,
    theta: ArrayLike,
    period: float,
    *,
    steps: int | None = None,
    further: int = 0,
) -> Memory:
    """
    Return a model at θ (p,), at rest, with derivatives by it.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array_like
    period : float
        Sampling period [s].
    steps : int, optional
        Steps of a sample of a model with laws; by default as in the filters.
    further : int
        Number of further derivatives, such as by the state at the start.
    """
    theta = np.asarray(theta, float)
    theta = np.where((theta == 0) & ~np.array(model.additive), LEAST, theta)
    planned = plan(model, theta, theta, period, steps=steps)
    lanes = padded(1 + len(theta) + further)
    arrays = axis_arrays(model, planned, period, lanes)
    return Memory(arrays | {"theta": theta, "X": np.zeros((model.n + 1, lanes))})


def along(simulated: Memory, u: Array) -> Array:
    """Return output and derivatives (N, lanes) after each of N torques; updates the states."""
    rows = np.zeros((len(u), simulated["X"].shape[1]))
    _along(simulated.block, simulated.at, u, rows, LAWS if len(simulated["laws"]) else None)
    return rows


@loop
def _along(block, at, u, rows, laws):
    state = views(Simulation, block, at)
    for k in range(len(u)):
        over_sample(state.axis, state.theta, state.X, u[k], laws)
        copy(rows, k, state.X, len(state.X) - 1)
