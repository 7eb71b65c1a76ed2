"""P(0) and Δ to start from: the paper's recipe, and its result for the nominal axis."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.design import make_design
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.model import Model, Parametrization
from flexaxis.estimators.reference import (
    discretize,
    extended_system,
    measurement_update,
    regularize,
    symmetrize,
    time_update,
)

Array = NDArray[np.float64]

# the recipe's result on the nominal axis and reference, for the paper's three parameters
P_FORGETTING = {"k_T": 2.97e-4, "1/J_a": 5.19e-5, "f_m": 4.69e-6}  # times (1−λ)/0.005
P_DRIFT = {"k_T": 5.6e-5, "1/J_a": 7.7e-5, "f_m": 7.1e-5}  # for Δ of eq. (32)
DRIFT = {"k_T": 5e-8, "1/J_a": 50e-8, "f_m": 500e-8}  # eq. (32)
RELATIVE_DRIFT = 3.2e-6  # geometric mean of Δ_ii/θ_i² in (32)


def gradient(model: Parametrization, theta: ArrayLike, u: ArrayLike, period: float) -> Array:
    """
    Return ψ (N, p) along a torque u (N,) at fixed parameters, eq. (16)–(23).

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array_like
    u : (N,) array_like
    period : float
        Sampling period [s].
    """
    F, G, H = extended_system(model, np.asarray(theta, float))
    transition, gain = discretize(F, G, period)
    # a state that starts every sample at zero has no influence on the next
    transition.reshape(len(F), -1, model.n)[:, :, list(model.reset)] = 0.0
    X = np.zeros(len(F))
    psi = np.empty((len(np.asarray(u)), len(H) - 1))
    for k, torque in enumerate(np.asarray(u, float)):
        psi[k] = H[:-1] @ X
        X = transition @ X + gain[:, 0] * torque
    return psi


def nominal_P(
    model: Model,
    u: ArrayLike,
    *,
    identify: Sequence[str] = ("k_T", "1/J_a", "f_m"),
    period: float = 0.005,
    forgetting: float | None = None,
    drift: ArrayLike | None = None,
    regularization: float = 0.0,
    output: str = "speed",
) -> Array:
    """
    Return the diagonal of P(0) by the recipe of the paper's section 5.2.

    P is updated with ψ computed at the nominal parameters; the mean of its diagonal over the
    second half of the record, after the transient, is P(0).

    Parameters
    ----------
    model : Model
    u : (N,) array_like
        Torque of a nominal run, some tens of seconds of it.
    identify, period, forgetting, drift, regularization, output
        As for `flexaxis.estimators.Rpem`.

    Returns
    -------
    (p,) array

    Raises
    ------
    EstimatorError
        If an option or the torque cannot be used.
    """
    design = make_design(
        model,
        identify=identify,
        theta0=None,
        P0=(parametrization := model.parametrize(identify)).theta ** 2 / 100,
        period=period,
        forgetting=forgetting,
        drift=drift,
        regularization=regularization,
        bounds=None,
        output=output,
    )
    P, kept = design.P0, []
    for psi in gradient(design.model, parametrization.theta, u, period):
        P = symmetrize(measurement_update(P, psi))
        P = symmetrize(time_update(P, design.forgetting, design.drift))
        P = symmetrize(regularize(P, design.regularization))
        kept.append(np.diag(P))
    if not kept:
        raise EstimatorError("u is empty; give the torque of some tens of seconds")
    return np.mean(kept[len(kept) // 2 :], axis=0)


def default_drift(names: Sequence[str], theta: Array) -> Array:
    """
    Return the diagonal of Δ: eq. (32) for the paper's parameters, else 3.2e-6·θ².

    The second is the geometric mean of what (32) means relative to the paper's nominal values.

    Parameters
    ----------
    names : sequence of str
    theta : (p,) array
        Nominal values.
    """
    return np.array(
        [DRIFT.get(n, RELATIVE_DRIFT * t**2) for n, t in zip(names, theta, strict=True)]
    )


def known_P(names: Sequence[str], *, forgetting: float | None, scale: float = 1.0) -> Array | None:
    """
    Return P(0) of the nominal axis for the paper's three parameters, None for any others.

    Parameters
    ----------
    names : sequence of str
    forgetting : float or None
        λ, with which P goes as 1−λ; None for covariance modification.
    scale : float
        Factor on Δ of eq. (32), with which P goes as its root.

    Returns
    -------
    (p,) array or None
    """
    if set(names) != set(DRIFT):
        return None
    if forgetting is None:
        return np.array([P_DRIFT[name] for name in names]) * np.sqrt(scale)
    # λ = 1 has no steady state; start it as λ = 0.9999
    return np.array([P_FORGETTING[name] for name in names]) * max(1 - forgetting, 1e-4) / 0.005
