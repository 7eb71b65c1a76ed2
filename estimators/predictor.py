"""The output-error predictor and its gradient at fixed parameters, for a whole record at once."""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.model import Parametrization
from flexaxis.estimators.reference import discretize, extended_system

Array = NDArray[np.float64]


def predict(
    model: Parametrization, theta: ArrayLike, u: ArrayLike, *, period: float = 0.005
) -> tuple[Array, Array]:
    """
    Return ŷ (N,) and its gradient ψ (N, p) for a torque u (N,), from rest; eq. (15)–(23).

    Exact for a torque that is held over each sample.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array_like
        Identified parameters.
    u : (N,) array_like
        Torque; u[k] is held on [t_k, t_{k+1}) and first acts on ŷ[k+1].
    period : float
        Sampling period T [s].
    """
    transition, gain, output = sampled_system(model, theta, period)
    outputs = _respond(transition, gain, output, np.ascontiguousarray(u, float))
    return outputs[:, -1], outputs[:, :-1]


def sampled_system(
    model: Parametrization, theta: ArrayLike, period: float
) -> tuple[Array, Array, Array]:
    """
    Return the extended system (22), (23) for a torque held over each sample.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array_like
        Identified parameters.
    period : float
        Sampling period T [s].

    Returns
    -------
    transition : ((p+1)n, (p+1)n) array
        Φ in X[k+1] = Φ X[k] + Γ u[k].
    gain : ((p+1)n,) array
        Γ.
    output : (p+1, (p+1)n) array
        H in [ψ; ŷ] = H X.
    """
    F, G, H = extended_system(model, np.asarray(theta, float))
    transition, gain = discretize(F, G, period)
    # a state that starts every sample at zero has no influence on the next
    transition.reshape(len(F), -1, model.n)[:, :, list(model.reset)] = 0.0
    return np.ascontiguousarray(transition), gain[:, 0].copy(), H


@njit(cache=True, nogil=True)
def _respond(transition, gain, output, u):
    X = np.zeros(len(transition))
    outputs = np.empty((len(u), len(output)))
    for k in range(len(u)):
        outputs[k] = output @ X
        X = transition @ X + gain * u[k]
    return outputs
