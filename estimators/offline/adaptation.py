"""
How fast and how noisy a recursive estimate is, and the Δ that makes it as fast as wanted.

Around the true parameters the error of the estimate follows θ̃ ← (I − P Q) θ̃ + P ψ e on average,
with Q = E ψψᵀ and white noise e of variance σ². In steady state P is that of eq. (29) or (30), so
everything below follows from Q: L. Ljung and S. Gunnarsson, *Adaptation and tracking in system
identification – a survey*, Automatica 26 (1990) 7–21. It holds for slow adaptation: time constants
well above the memory of the plant.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm, sqrtm

from flexaxis.estimators.errors import EstimatorError

Array = NDArray[np.float64]


def steady_P(
    Q: ArrayLike, *, forgetting: float | None = None, drift: ArrayLike | None = None
) -> Array:
    """
    Return the steady state of P (p, p): (1−λ) Q⁻¹, eq. (29), or the P of P Q P = Δ, eq. (30).

    Parameters
    ----------
    Q : (p, p) array_like
        E ψψᵀ, eq. (31), as from `flexaxis.estimators.offline.frequency.information`.
    forgetting : float, optional
        λ, close to one.
    drift : (p,) or (p, p) array_like, optional
        Δ.

    Raises
    ------
    EstimatorError
        If not exactly one of forgetting and drift is given.
    """
    Q = np.asarray(Q, float)
    inverse = np.linalg.inv(Q)
    if (forgetting is None) == (drift is None):
        raise EstimatorError("give either forgetting (λ) or drift (Δ)")
    if forgetting is not None:
        return (1 - forgetting) * inverse
    # (P Q)² = Δ Q, and the square root with positive eigenvalues is the one wanted
    return sqrtm(_matrix(drift) @ Q).real @ inverse


def drift_for(
    time_constants: ArrayLike, Q: ArrayLike, *, period: float, coupled: bool = False
) -> Array:
    """
    Return the Δ (p, p) that lets every estimate follow with the time constant wanted.

    By default Δ is diagonal, Δ_ii = 1/(τ_i² Q_ii) with τ_i in samples: exact for parameters whose
    gradients are uncorrelated, since P_ii Q_ii = 1/τ_i then. Correlated ones slow each other down;
    ``coupled`` counts that in with Δ = D Q⁻¹ D, D = diag(1/τ_i), exact for equal time constants.

    Parameters
    ----------
    time_constants : (p,) array_like
        Wanted time constants τ_i [s], well above the memory of the plant.
    Q : (p, p) array_like
        E ψψᵀ at the nominal parameters.
    period : float
        Sampling period T [s].
    coupled : bool
        Whether Δ gets the off-diagonal elements.

    Raises
    ------
    EstimatorError
        If a time constant is shorter than a sample.
    """
    Q, samples = np.asarray(Q, float), np.asarray(time_constants, float) / period
    if not np.all(samples > 1):
        raise EstimatorError(
            f"time constants are {samples * period} s; give each longer than a sample, {period} s"
        )
    inverse = np.linalg.inv(Q) if coupled else np.diag(1 / np.diag(Q))
    return inverse / np.outer(samples, samples)


def tracking_error(P: ArrayLike, Q: ArrayLike, times: ArrayLike, *, period: float) -> Array:
    """
    Return what is left of an initial error after some times, E θ̃(t) = exp(−P Q t/T) θ̃(0).

    Parameters
    ----------
    P, Q : (p, p) array_like
        Steady P, and E ψψᵀ.
    times : (M,) array_like
        Times after the change [s].
    period : float
        Sampling period T [s].

    Returns
    -------
    (M, p, p) array
        Element (m, i, j): error of parameter i at time m for a unit error of parameter j.
    """
    rate = np.asarray(P, float) @ np.asarray(Q, float) / period
    return expm(-np.multiply.outer(np.asarray(times, float), rate))


def estimate_covariance(P: ArrayLike, noise_variance: float) -> Array:
    """
    Return the covariance σ² P/2 (p, p) of the estimates of a constant θ in steady state.

    It solves P Q Σ + Σ Q P = σ² P Q P for any P that eq. (29) or (30) can give.

    Parameters
    ----------
    P : (p, p) array_like
        Steady P, in the paper's units of noise variance one.
    noise_variance : float
        σ² of the output noise.
    """
    return noise_variance * np.asarray(P, float) / 2


def _matrix(value: ArrayLike | None) -> Array:
    value = np.asarray(value, float)
    return np.diag(value) if value.ndim == 1 else value
