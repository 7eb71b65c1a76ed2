"""
A model at fixed parameters along a torque, with its sensitivities, by the functions of the filters.

A simulation is a block of memory: the model, θ, and X (n+1, lanes) of states and, in its last row,
the output, each with its derivatives.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.compiler import inlined, loop
from flexaxis.estimators.models.discretisation import law_plan, plan
from flexaxis.estimators.models.memory import Memory, items, matrix
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.models.rows import copy, padded
from flexaxis.estimators.models.series import (
    FIELDS,
    axis_arrays,
    axis_in,
    lawful_sample,
    linear_sample,
)

Array = NDArray[np.float64]

LEAST = 1e-300  # of a parameter of the linear model, by which derivatives are taken


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
        Of a sample, of a model with laws; as many as filters take by default.
    further : int
        Derivatives to come beyond these, such as by the state at the start.
    """
    theta = np.asarray(theta, float)
    theta = np.where((theta == 0) & ~np.array(model.additive), LEAST, theta)
    here = model, theta, theta, period
    planned = law_plan(*here, steps=steps) if model.forces else plan(*here)
    lanes = padded(1 + len(theta) + further)
    arrays = axis_arrays(model, planned, period, lanes)
    return Memory(arrays | {"theta": theta, "X": np.zeros((model.n + 1, lanes))})


def along(simulated: Memory, u: Array) -> Array:
    """Return output and derivatives (N, lanes) after each of N torques; the states go along."""
    rows = np.zeros((len(u), simulated["X"].shape[1]))
    _along(simulated.block, simulated.at, u, rows)
    return rows


@loop
def _along(block, at, u, rows):
    axis, theta, X = simulation_in(block, at)
    for k in range(len(u)):
        any_sample(axis, theta, X, u[k])
        copy(rows, k, X, len(X) - 1)


@inlined
def simulation_in(block, at):
    """Return model, θ and X of a block."""
    return (
        axis_in(block, at),
        items(block, at[FIELDS])[0],
        matrix(block, at[FIELDS + 1])[0],
    )


@inlined
def any_sample(axis, theta, X, u):
    """Take X over a sample, whether the model has laws or not."""
    if len(axis.laws):
        lawful_sample(axis, theta, X, u)
    else:
        linear_sample(axis, theta, X, u)
