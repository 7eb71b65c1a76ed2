"""
Initial values P(0) and Δ, and the resulting tracking speed and noise of the estimates.

P(0) and Δ are computed by the paper's recipe, and the results for the nominal axis are stored. Near
the true parameters, the error of the estimate follows θ̃ ← (I − P Q) θ̃ + P ψ e on average, with
Q = E ψψᵀ and white noise e of variance σ². In steady state, P fulfils eq. (29) or (30), so P, the
tracking speed and the noise depend only on Q (L. Ljung and S. Gunnarsson, *Adaptation and tracking
in system identification – a survey*, Automatica 26 (1990) 7–21). The theory applies to slow
adaptation, with time constants much longer than the memory of the plant.
"""

import pickle
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.filters.design import covariance_matrix, make_design
from flexaxis.estimators.filters.prediction_error import form, grow
from flexaxis.estimators.filters.state import subtract
from flexaxis.estimators.models.compiler import compiled
from flexaxis.estimators.models.meaning import is_nominal_axis, moves_as_nominal
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.offline.predictor import as_torque, predict
from flexaxis.estimators.signals import find_signal

Array = NDArray[np.float64]

# results of the recipe for the paper's three parameters, the nominal axis and its reference motion
P_FORGETTING = {"k_T": 2.97e-4, "1/J_a": 5.19e-5, "f_m": 4.69e-6}  # multiplied by (1−λ)/0.005
P_DRIFT = {"k_T": 5.6e-5, "1/J_a": 7.7e-5, "f_m": 7.1e-5}  # for Δ of eq. (32)
DRIFT = {"k_T": 5e-8, "1/J_a": 50e-8, "f_m": 500e-8}  # eq. (32)
RELATIVE_DRIFT = 3.2e-6  # geometric mean of Δ_ii/θ_i² in (32)
# s, time constants T/√(Δ_ii Q_ii) for Δ of (32) and Q of the nominal run; geometric mean
FOLLOWS = {"k_T": 4.5, "1/J_a": 0.68, "f_m": 0.056}
FOLLOWS_MEAN = 0.56
PERIOD = 0.005  # T [s] for which these values are valid, on the nominal axis


def nominal_P(
    model: Model,
    u: ArrayLike,
    *,
    identify: Sequence[str] | None = None,
    period: float,
    **options: Any,
) -> Array:
    """
    Return the diagonal of P(0), computed by the recipe of the paper's section 5.2.

    P is updated with ψ computed at the nominal parameters. P(0) is the mean of the diagonal of P
    over the second half of the record, after the transient.

    Parameters
    ----------
    model : Model
    u : (N,) array_like
        Torque of a nominal run with a duration of some tens of seconds.
    identify, period, **options
        Options of `flexaxis.estimators.Rpem`, such as ``forgetting``, ``drift``, ``regularization``
        and ``output``.

    Returns
    -------
    (p,) array
        Diagonal of P(0), for a noise variance of one.

    Raises
    ------
    EstimatorError
        If an option or the torque is invalid.
    """
    first = model.parametrize(identify).theta ** 2 / 100
    design = make_design(model, identify=identify, P0=first, period=period, **options)
    # the design, and therefore P, is expressed in relative parameters
    psi = _gradient_along(design.model, design.theta0, u, design.period)
    # an approximate steady state, eq. (29) or (30) for each parameter
    Q, drift, forgotten = _energy(psi), np.diag(design.drift), 1 - design.forgetting
    P = np.where(drift > 0, np.sqrt(drift / Q), max(forgotten, 1 / len(psi)) / Q)
    rules = design.forgetting, design.drift, design.regularization
    return _mean_diagonal(psi, np.diag(P), *rules) * design.scale**2


def _gradient_along(model: Parametrization, theta: Array, u: ArrayLike, period: float) -> Array:
    """Return ψ (N, p) for a torque u (N,); results for recent axes and torques are cached."""
    return _remembered(pickle.dumps((model, theta, as_torque(u), period)))


def _energy(psi: Array) -> Array:
    return np.maximum(np.mean(psi**2, axis=0), np.finfo(float).tiny)


# A benchmark constructs many estimators for every record, and all of them use the same gradient.
@lru_cache(maxsize=32)
def _remembered(content: bytes) -> Array:
    model, theta, u, period = pickle.loads(content)
    return predict(model, theta, u, period=period)[1]


@compiled
def _mean_diagonal(psi, P, forgetting, drift, regularization):
    """Update P with ψ (N, p), eq. (7), (9), (10), (12); return the mean diagonal, second half."""
    N, p = psi.shape
    gain, total = np.empty(p), np.zeros(p)
    for k in range(N):
        weight = 1.0 / (1.0 + form(P, psi[k], gain))
        subtract(P, gain, weight)
        grow(P, gain, forgetting, drift, regularization)
        for i in range(p if k >= N // 2 else 0):
            total[i] += P[i, i]
    return total / (N - N // 2)


def default_drift(
    model: Model,
    identify: Sequence[str],
    period: float,
    *,
    torque: ArrayLike | None = None,
    output: str = "speed",
) -> Array:
    """
    Return the default diagonal of Δ.

    With a torque, Δ_ii = (T/τ_i)²/Q_ii, where Q_ii is the mean of ψ_i² for this torque. Estimate i
    then follows changes with the time constant τ_i, independent of units. If the poles of the model
    are similar to those of the nominal axis, τ_i are the time constants that result from eq. (32)
    on the nominal axis. For any other model, all τ_i equal the geometric mean of these time
    constants. Without a torque, Δ is taken from eq. (32) for the nominal axis and is proportional
    to θ_i² for any other axis. In both cases Δ is proportional to T².

    Parameters
    ----------
    model : Model
    identify : sequence of str
        Names of the identified parameters, or of their inverses.
    period : float
        Sampling period T [s]; Δ is the covariance that P gains per sample.
    torque : (N,) array_like, optional
        Torque of a nominal run [N m].
    output : {"speed", "increment"}
        Kind of signal y.
    """
    theta = model.parametrize(identify).theta
    if torque is not None:
        chosen = find_signal(output).predicted(model, period)
        Q = _energy(_gradient_along(chosen.parametrize(identify), theta, torque, period))
        usual = FOLLOWS if moves_as_nominal(model) else {}
        return (period / np.array([usual.get(n, FOLLOWS_MEAN) for n in identify])) ** 2 / Q
    # the values of eq. (32) are valid even if the estimates start elsewhere
    known = DRIFT if is_nominal_axis(model, identify) else {}
    relative = zip(identify, RELATIVE_DRIFT * theta**2, strict=True)
    return (period / PERIOD) ** 2 * np.array([known.get(name, usual) for name, usual in relative])


def stored_P(
    model: Model,
    identify: Sequence[str],
    period: float,
    *,
    forgetting: float | None,
    scale: float = 1.0,
) -> Array | None:
    """
    Return the result of `known_P` if the axis, its units and the period are the nominal ones.

    Parameters
    ----------
    model : Model
    identify : sequence of str
        Names of the identified parameters, or of their inverses.
    period : float
        Sampling period [s].
    forgetting, scale
        Parameters of `known_P`.

    Returns
    -------
    (p,) array or None
        Diagonal of P(0), or None if the axis, the period or the parameters differ.
    """
    if period != PERIOD or not is_nominal_axis(model, identify):
        return None
    return known_P(identify, forgetting=forgetting, scale=scale)


def known_P(names: Sequence[str], *, forgetting: float | None, scale: float = 1.0) -> Array | None:
    """
    Return P(0) of the nominal axis for the paper's three parameters, or None for other parameters.

    The values apply to the units and the period of the nominal axis, which `stored_P` checks.

    Parameters
    ----------
    names : sequence of str
        Names of the identified parameters, or of their inverses.
    forgetting : float or None
        Forgetting factor λ, where P is proportional to 1−λ; None for covariance modification.
    scale : float
        Factor by which Δ of eq. (32) is multiplied; P is proportional to its square root.

    Returns
    -------
    (p,) array or None
        Diagonal of P(0).
    """
    if set(names) != set(DRIFT):
        return None
    if forgetting is None:
        return np.array([P_DRIFT[name] for name in names]) * np.sqrt(scale)
    # for λ = 1 there is no steady state; use the value for λ = 0.9999
    return np.array([P_FORGETTING[name] for name in names]) * max(1 - forgetting, 1e-4) / 0.005


def steady_P(
    Q: ArrayLike, *, forgetting: float | None = None, drift: ArrayLike | None = None
) -> Array:
    """
    Return the steady state of P (p, p): (1−λ) Q⁻¹, eq. (29), or the solution of P Q P = Δ, (30).

    Parameters
    ----------
    Q : (p, p) array_like
        Matrix E ψψᵀ, eq. (31), such as the result of
        `flexaxis.estimators.offline.frequency.information`.
    forgetting : float, optional
        Forgetting factor λ, close to one.
    drift : (p,) or (p, p) array_like, optional
        Covariance Δ or its diagonal.

    Raises
    ------
    EstimatorError
        If both or neither of forgetting and drift are given.
    """
    Q = np.asarray(Q, float)
    inverse = np.linalg.inv(Q)
    if forgetting is not None and drift is None:
        return (1 - forgetting) * inverse
    if drift is None or forgetting is not None:
        raise EstimatorError("give either forgetting (λ) or drift (Δ)")
    # (P Q)² = Δ Q, so P Q is the square root of Δ Q with positive eigenvalues
    from scipy.linalg import sqrtm  # takes a tenth of a second to import

    return sqrtm(covariance_matrix("drift", drift, len(inverse)) @ Q).real @ inverse


def drift_for(
    time_constants: ArrayLike, Q: ArrayLike, *, period: float, coupled: bool = False
) -> Array:
    """
    Return the matrix Δ (p, p) for which every estimate follows changes with a given time constant.

    By default Δ is diagonal, Δ_ii = 1/(τ_i² Q_ii) with τ_i in samples. This choice is exact if the
    gradients of the parameters are uncorrelated, because P_ii Q_ii = 1/τ_i in this case. Correlated
    parameters slow each other down. The option ``coupled`` takes this effect into account with
    Δ = D Q⁻¹ D, D = diag(1/τ_i). This matrix is exact for equal time constants.

    Parameters
    ----------
    time_constants : (p,) array_like
        Desired time constants τ_i [s], much longer than the memory of the plant.
    Q : (p, p) array_like
        Matrix E ψψᵀ at the nominal parameters.
    period : float
        Sampling period T [s].
    coupled : bool
        Whether to compute off-diagonal elements of Δ from Q.

    Raises
    ------
    EstimatorError
        If a time constant is shorter than a sample.
    """
    Q, samples = np.asarray(Q, float), np.asarray(time_constants, float) / period
    if not np.all(samples > 1):
        raise EstimatorError(
            f"time constants are {samples * period} s; each must exceed the period of {period} s"
        )
    inverse = np.linalg.inv(Q) if coupled else np.diag(1 / np.diag(Q))
    return inverse / np.outer(samples, samples)


def tracking_error(P: ArrayLike, Q: ArrayLike, times: ArrayLike, *, period: float) -> Array:
    """
    Return the remaining fraction of an initial error, E θ̃(t) = exp(−P Q t/T) θ̃(0).

    Parameters
    ----------
    P, Q : (p, p) array_like
        Steady-state P, and the matrix E ψψᵀ.
    times : (M,) array_like
        Times after the change [s].
    period : float
        Sampling period T [s].

    Returns
    -------
    (M, p, p) array
        Errors; element (m, i, j) is the error of parameter i at time m caused by an initial error
        of one in parameter j.
    """
    rate = np.asarray(P, float) @ np.asarray(Q, float) / period
    from scipy.linalg import expm

    return expm(-np.multiply.outer(np.asarray(times, float), rate))


def estimate_covariance(P: ArrayLike, noise_variance: float) -> Array:
    """
    Return the covariance σ² P/2 (p, p) of the estimates of a constant θ in steady state.

    This covariance Σ solves P Q Σ + Σ Q P = σ² P Q P for any P that fulfils eq. (29) or (30).

    Parameters
    ----------
    P : (p, p) array_like
        Steady-state P, for a noise variance of one as in the paper.
    noise_variance : float
        Variance σ² of the output noise.
    """
    return noise_variance * np.asarray(P, float) / 2
