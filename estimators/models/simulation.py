"""Simulation of a model and its sensitivities at fixed parameters, with the code of the filters."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.compiler import loop
from flexaxis.estimators.models.discretisation import plan
from flexaxis.estimators.models.matrix_rows import copy, padded
from flexaxis.estimators.models.memory import Matrix, Memory, Vector, views
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.models.series import LAWS, Axis, axis_arrays, over_sample

Array = NDArray[np.float64]

LEAST = 1e-300  # value that replaces a zero parameter of the linear model


class Simulation(NamedTuple):
    """The model, the parameters θ (p,), and X (n+1, lanes) with states, output and derivatives."""

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
    Return the memory for simulating a model and its derivatives from rest.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array_like
        Identified parameters.
    period : float
        Sampling period [s].
    steps : int, optional
        Number of steps per sample for a model with nonlinear torques; by default, the number that
        the filters use.
    further : int
        Number of derivatives besides those with respect to θ, for example derivatives with respect
        to the initial state.
    """
    theta = np.asarray(theta, float)
    theta = np.where((theta == 0) & ~np.array(model.additive), LEAST, theta)
    lanes = padded(1 + len(theta) + further)
    arrays = axis_arrays(model, plan(model, theta, theta, period, steps=steps), period, lanes)
    return Memory(arrays | {"theta": theta, "X": np.zeros((model.n + 1, lanes))})


def along(simulated: Memory, u: Array) -> Array:
    """Simulate N samples with torques u; return the output and its derivatives (N, lanes)."""
    rows = np.zeros((len(u), simulated["X"].shape[1]))
    _along(simulated.block, simulated.at, u, rows, LAWS if len(simulated["laws"]) else None)
    return rows


@loop
def _along(block, at, u, rows, laws):
    state = views(Simulation, block, at)
    for k in range(len(u)):
        over_sample(state.axis, state.theta, state.X, u[k], laws)
        copy(rows, k, state.X, len(state.X) - 1)
