"""The extended system of state and sensitivities, sampled by a matrix exponential: the oracle."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.parametrization import Parametrization

Array = NDArray[np.float64]


def extended_system(model: Parametrization, theta: Array) -> tuple[Array, Array, Array]:
    """
    Return the extended system of eq. (22), (23), one block z_i for each parameter.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array

    Returns
    -------
    F : ((p+1)n, (p+1)n) array
        Ẋ = F X + G u for X = [z_1; …; z_p; x].
    G : ((p+1)n, 1) array
    H : (p+1, (p+1)n) array
        [ψ; ŷ] = H X.
    """
    (A, B, C), (dA, dB, dC) = model.matrices(theta), model.derivatives(theta)
    p, n = len(dA), model.n
    F, H = np.zeros(((p + 1) * n, (p + 1) * n)), np.zeros((p + 1, (p + 1) * n))
    for i in range(p + 1):
        block = slice(i * n, (i + 1) * n)
        F[block, block], H[i, block] = A, C
    F[:-n, -n:] = dA.reshape(p * n, n)
    H[:-1, -n:] = dC.reshape(p, n)
    G = np.concatenate([*dB, B])
    return F, G, H


def discretize(F: Array, G: Array, period: float) -> tuple[Array, Array]:
    """Return Φ, Γ of X[k+1] = Φ X[k] + Γ u[k], the input held over the sample."""
    from scipy.linalg import expm  # takes a tenth of a second to import

    N = len(F)
    held = np.zeros((N + 1, N + 1))  # the input is one more state, which does not change
    held[:N, :N], held[:N, N:] = F, G
    exponential = expm(held * period)
    return exponential[:N, :N], exponential[:N, N:]


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
