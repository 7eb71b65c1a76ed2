"""
Initial covariance P(0), drift covariance Δ, and the resulting speed and noise of the estimates.

The functions in `priors` compute P(0) and Δ by the recipe of Östring and Gunnarsson. The module
also contains stored values of P(0) and Δ for the nominal axis. Near the true parameters, the
estimation error evolves on average as θ̃ ← (I − P Q) θ̃ + P ψ e, where Q = E ψψᵀ and e is white
noise of variance σ². In steady state, P fulfils equation (29) or (30), so P, the tracking speed and
the noise of the estimates depend only on Q. The theory comes from *Adaptation and tracking in
system identification – a survey* (Ljung and Gunnarsson, 1990). The theory applies to slow
adaptation, with time constants that are much longer than those of the axis.
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
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parameter_meaning import is_nominal_axis, moves_as_nominal
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.offline.predictor import as_torque, predict
from flexaxis.estimators.signals import find_signal

Array = NDArray[np.float64]

# results of the recipe for the paper's three parameters, the nominal axis and its reference motion
P_FORGETTING = {"k_T": 2.97e-4, "1/J_a": 5.19e-5, "f_m": 4.69e-6}  # multiplied by (1−λ)/0.005
P_DRIFT = {"k_T": 5.6e-5, "1/J_a": 7.7e-5, "f_m": 7.1e-5}  # for Δ of eq. (32)
DRIFT = {"k_T": 5e-8, "1/J_a": 50e-8, "f_m": 500e-8}  # eq. (32)
RELATIVE_DRIFT = 3.2e-6  # geometric mean of Δ_ii/θ_i² in (32)
# s, time constants T/√(Δ_ii Q_ii) for Δ of (32) and Q of the nominal run, and their geometric mean
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
    Compute the diagonal of P(0) by the recipe in section 5.2 of Östring and Gunnarsson.

    The recipe updates P with the gradient ψ at the nominal parameters. The returned diagonal of
    P(0) is that of P, averaged over the second half of the record, after the transient.

    Parameters
    ----------
    model : Model
    u : (N,) array_like
        Motor torque of a nominal motion that lasts a few tens of seconds.
    identify, period, **options : Any
        Options of `flexaxis.estimators.Rpem`, such as ``forgetting``, ``drift``, ``regularization``
        and ``output``.

    Returns
    -------
    (p,) array
        Diagonal of P(0) for a noise variance of one.

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
    """Return the gradient ψ (N, p) for a torque u (N,); recent results are cached."""
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
    """Update P with N gradients ψ (N, p); return the mean diagonal of the last N/2 matrices P."""
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
    Return the default diagonal of the drift covariance Δ.

    If ``torque`` is given, Δ_ii = (T/τ_i)²/Q_ii, where Q_ii is the mean of ψ_i² for this torque.
    The estimate of θ_i then tracks parameter changes with the time constant τ_i, regardless of the
    units. If the poles of the model are similar to those of the nominal axis, the τ_i are the time
    constants that equation (32) implies for the nominal axis. For any other model, all τ_i equal
    the geometric mean of the time constants for the nominal axis. If no torque is given, equation
    (32) provides Δ_ii for the nominal axis; for any other axis, Δ_ii is proportional to θ_i². With
    or without a torque, the default Δ is proportional to the squared sampling period T².

    Parameters
    ----------
    model : Model
    identify : sequence of str
        Names of the identified parameters or inverse parameters.
    period : float
        Sampling period T [s]. In each sampling period, P increases by Δ.
    torque : (N,) array_like, optional
        Motor torque of a nominal motion [N m].
    output : {"speed", "increment"}
        Type of the output signal y.
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
    Return the stored P(0) of the nominal axis, or None for any other axis.

    Parameters
    ----------
    model : Model
    identify : sequence of str
        Names of the identified parameters or inverse parameters.
    period : float
        Sampling period [s].
    forgetting, scale : float
        Arguments for `known_P`.

    Returns
    -------
    (p,) array or None
        Diagonal of P(0), or None if the model, the units, the period or the parameters differ from
        those of the nominal axis.
    """
    if period != PERIOD or not is_nominal_axis(model, identify):
        return None
    return known_P(identify, forgetting=forgetting, scale=scale)


def known_P(names: Sequence[str], *, forgetting: float | None, scale: float = 1.0) -> Array | None:
    """
    Return the stored P(0) for the parameters k_T, 1/J_a and f_m, or None for other parameters.

    The stored values are valid only for the nominal axis, its units and its sampling period;
    `stored_P` checks these conditions.

    Parameters
    ----------
    names : sequence of str
        Names of the identified parameters or inverse parameters.
    forgetting : float or None
        Forgetting factor λ, or None for covariance modification. P(0) is proportional to 1−λ.
    scale : float
        Factor that multiplies Δ of equation (32). P(0) is proportional to the square root of
        ``scale``.

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
    Return the steady-state matrix P (p, p) for a forgetting factor or a drift covariance.

    Parameters
    ----------
    Q : (p, p) array_like
        Matrix E ψψᵀ of equation (31), such as the matrix that
        `flexaxis.estimators.offline.frequency.information` returns.
    forgetting : float, optional
        Forgetting factor λ, close to one. If ``forgetting`` is given, the steady state is P = (1−λ)
        Q⁻¹, as in equation (29).
    drift : (p,) or (p, p) array_like, optional
        Drift covariance Δ, or the diagonal of Δ. If ``drift`` is given, the steady state of P
        solves P Q P = Δ, equation (30).

    Raises
    ------
    EstimatorError
        If neither forgetting nor drift is given, or if both options are given.
    """
    Q = np.asarray(Q, float)
    inverse = np.linalg.inv(Q)
    if forgetting is not None and drift is None:
        return (1 - forgetting) * inverse
    if drift is None or forgetting is not None:
        raise EstimatorError("give either forgetting (λ) or drift (Δ), but not both options")
    # (P Q)² = Δ Q, so P Q is the square root of Δ Q with positive eigenvalues
    from scipy.linalg import sqrtm  # takes a tenth of a second to import

    return sqrtm(covariance_matrix("drift", drift, len(inverse)) @ Q).real @ inverse


def drift_for(
    time_constants: ArrayLike, Q: ArrayLike, *, period: float, coupled: bool = False
) -> Array:
    """
    Return the matrix Δ (p, p) that gives each estimate the desired time constant.

    By default, Δ is diagonal with Δ_ii = 1/(τ_i² Q_ii), where τ_i is the time constant in samples.
    The diagonal Δ gives exactly the desired time constants if the parameter gradients are
    uncorrelated, because then P_ii Q_ii = 1/τ_i. If the parameter gradients are correlated, the
    estimates slow each other down. If ``coupled`` is True, Δ = D Q⁻¹ D with D = diag(1/τ_i), which
    accounts for correlated gradients. The coupled Δ gives exactly the desired time constants if
    they are all equal.

    Parameters
    ----------
    time_constants : (p,) array_like
        Desired time constants [s], which must be much longer than those of the axis.
    Q : (p, p) array_like
        Matrix Q = E ψψᵀ of the gradient ψ at the nominal parameters.
    period : float
        Sampling period T [s].
    coupled : bool
        Whether the function computes off-diagonal elements of Δ from Q.

    Raises
    ------
    EstimatorError
        If a time constant does not exceed the sampling period.
    """
    Q, samples = np.asarray(Q, float), np.asarray(time_constants, float) / period
    if not np.all(samples > 1):
        raise EstimatorError(
            f"time_constants is {samples * period} s, but each value must exceed the sampling "
            f"period of {period} s"
        )
    inverse = np.linalg.inv(Q) if coupled else np.diag(1 / np.diag(Q))
    return inverse / np.outer(samples, samples)


def tracking_error(P: ArrayLike, Q: ArrayLike, times: ArrayLike, *, period: float) -> Array:
    """
    Return exp(−P Q t/T), the fraction of an initial estimation error that remains at time t.

    Parameters
    ----------
    P, Q : (p, p) array_like
        Steady-state matrix P, and the matrix Q = E ψψᵀ.
    times : (M,) array_like
        Times t after a parameter change [s].
    period : float
        Sampling period T [s].

    Returns
    -------
    (M, p, p) array
        Mean estimation errors. Element (m, i, j) is the error of parameter i at ``times[m]`` due to
        an initial unit error of parameter j.
    """
    rate = np.asarray(P, float) @ np.asarray(Q, float) / period
    from scipy.linalg import expm

    return expm(-np.multiply.outer(np.asarray(times, float), rate))


def estimate_covariance(P: ArrayLike, noise_variance: float) -> Array:
    """
    Return the steady-state covariance σ² P/2 (p, p) of the estimates of a constant θ.

    The covariance Σ = σ² P/2 solves P Q Σ + Σ Q P = σ² P Q P for any P that fulfils equation (29)
    or (30).

    Parameters
    ----------
    P : (p, p) array_like
        Steady-state matrix P for a noise variance of one.
    noise_variance : float
        Variance σ² of the output noise.
    """
    return noise_variance * np.asarray(P, float) / 2
