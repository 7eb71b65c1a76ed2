"""The output-error predictor and its gradient at fixed parameters, for a whole record at once."""

import reprlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.compiler import compiled
from flexaxis.estimators.models.discretisation import sampled_system
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.models.prepared import copy, prepare, travel
from flexaxis.estimators.models.sampled import planned

Array = NDArray[np.float64]


def as_torque(given: ArrayLike) -> Array:
    """
    Return the torque of a run (N,) [N m] as floats, one behind the other in memory.

    Raises
    ------
    EstimatorError
        If it is none.
    """
    try:
        found = np.ascontiguousarray(given, float)
        if np.iscomplexobj(given) or np.ndim(given) != 1 or not len(found):
            raise ValueError
    except (TypeError, ValueError):
        said = " ".join(reprlib.repr(given).split())
        raise EstimatorError(f"torque is {said}: give that of a run, (N,) numbers [N m]") from None
    return found


def predict(
    model: Parametrization, theta: ArrayLike, u: ArrayLike, *, period: float
) -> tuple[Array, Array]:
    """
    Return ŷ (N,) and its gradient ψ (N, p) for a torque u (N,), from rest; eq. (15)–(23).

    Exact for a torque that is held over each sample, but for nonlinear laws, which
    `flexaxis.estimators.models.reaction` solves.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array_like
        Identified parameters.
    u : (N,) array_like
        Torque; u[k] is held on [t_k, t_{k+1}) and first acts on ŷ[k+1].
    period : float
        Sampling period T [s].

    Raises
    ------
    EstimatorError
        If u is no torque.
    """
    if model.laws is not None:
        at = np.asarray(theta, float)
        ready = prepare(planned(model, at, at, period), at, np.arange(len(at)))
        rows = _along(ready, np.zeros((1 + len(at), model.n + 1)), as_torque(u))
        return rows[:, 0].copy(), rows[:, 1:].copy()
    transition, gain, output = sampled_system(model, theta, period)
    outputs = respond(transition, gain, output, as_torque(u))
    return outputs[:, -1], outputs[:, :-1]


@compiled
def _along(ready, X, u):
    """Return output and gradient (N, 1+p) along a record, from rest; X is lost."""
    moved, rows = np.zeros_like(X), np.zeros((len(u), len(X)))
    for k in range(len(u) - 1):
        travel(ready, X, moved, u[k])
        copy(moved, X)
        for a in range(len(X)):
            rows[k + 1, a] = X[a, X.shape[1] - 1]
    return rows


@compiled
def respond(transition, gain, output, u):
    """
    Return output @ X (N, m) of X[k+1] = Φ X[k] + Γ u[k], from rest.

    Element by element where no product of matrices is: slices take the compiler seconds.
    """
    X = np.zeros(len(transition))
    outputs = np.empty((len(u), len(output)))
    for k in range(len(u)):
        row, moved = np.dot(output, X), np.dot(transition, X)
        for i in range(len(row)):
            outputs[k, i] = row[i]
        for i in range(len(X)):
            X[i] = moved[i] + gain[i] * u[k]
    return outputs
