"""The output-error predictor and its gradient at fixed parameters, for a whole record."""

import reprlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.compiler import compiled
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.models.simulation import along, simulation

Array = NDArray[np.float64]


def as_torque(values: ArrayLike) -> Array:
    """
    Convert a torque record [N m] to a contiguous array of floats (N,).

    Raises
    ------
    EstimatorError
        If the torque values are not a one-dimensional, nonempty array of real numbers.
    """
    try:
        torque = np.ascontiguousarray(values, float)
        if np.iscomplexobj(values) or np.ndim(values) != 1 or not len(torque):
            raise ValueError
    except (TypeError, ValueError):
        text = " ".join(reprlib.repr(values).split())
        raise EstimatorError(
            f"torque is {text}; give the torque of a run in N m, one number for each sample"
        ) from None
    return torque


def predict(
    model: Parametrization, theta: ArrayLike, u: ArrayLike, *, period: float
) -> tuple[Array, Array]:
    """
    Return the prediction ŷ (N,) and its gradient ψ (N, p) for an axis that starts at rest.

    Equations (15)–(23) define the prediction. The prediction is exact for a linear model if the
    torque is constant over each sample. For a model with nonlinear torques,
    `flexaxis.estimators.models.implicit_torque` solves the equations numerically.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array_like
        Identified parameters.
    u : (N,) array_like
        Torque; u[k] is the constant torque between t_k and t_{k+1}, and first acts on ŷ[k+1].
    period : float
        Sampling period T [s].

    Raises
    ------
    EstimatorError
        If the torque u is not a one-dimensional, nonempty array of real numbers.
    """
    rows = along(simulation(model, theta, period), as_torque(u)[:-1])
    rows = np.vstack([np.zeros(rows.shape[1]), rows])
    return rows[:, 0].copy(), rows[:, 1 : 1 + len(model.names)].copy()


@compiled
def respond(transition, gain, u):
    """Return the states X (N, n) that follow from X[k+1] = Φ X[k] + Γ u[k] with X[0] = 0."""
    X = np.zeros((len(u), len(gain)))
    for k in range(len(u) - 1):
        X[k + 1] = np.dot(transition, X[k]) + gain * u[k]
    return X
