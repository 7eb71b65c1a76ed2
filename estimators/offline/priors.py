"""
P(0) and Δ to start from, and how fast and how noisy an estimate with them is.

The paper's recipe, and its result for the nominal axis. Around the true parameters the error of
the estimate follows θ̃ ← (I − P Q) θ̃ + P ψ e on average, with Q = E ψψᵀ and white noise e of
variance σ². In steady state P is that of eq. (29) or (30), so everything follows from Q:
L. Ljung and S. Gunnarsson, *Adaptation and tracking in system identification – a survey*,
Automatica 26 (1990) 7–21. It holds for slow adaptation: time constants well above the memory of
the plant.
"""

import pickle
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.filters.design import Design, make_design
from flexaxis.estimators.filters.prediction_error import subtract
from flexaxis.estimators.models.compiler import compiled
from flexaxis.estimators.models.meaning import is_axis, moves_as, named_values
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.offline.predictor import as_torque, predict
from flexaxis.estimators.signals import find_signal

Array = NDArray[np.float64]

# the recipe's result on the nominal axis and reference, for the paper's three parameters
P_FORGETTING = {"k_T": 2.97e-4, "1/J_a": 5.19e-5, "f_m": 4.69e-6}  # times (1−λ)/0.005
P_DRIFT = {"k_T": 5.6e-5, "1/J_a": 7.7e-5, "f_m": 7.1e-5}  # for Δ of eq. (32)
DRIFT = {"k_T": 5e-8, "1/J_a": 50e-8, "f_m": 500e-8}  # eq. (32)
RELATIVE_DRIFT = 3.2e-6  # geometric mean of Δ_ii/θ_i² in (32)
# s, time constants T/√(Δ_ii Q_ii) of (32), with Q of the nominal reference, and their mean
FOLLOWS = {"k_T": 4.5, "1/J_a": 0.68, "f_m": 0.056}
FOLLOWS_MEAN = 0.56
AXIS, PERIOD = "n1", 0.005  # where these hold: axis, T [s]


def nominal_P(
    model: Model,
    u: ArrayLike,
    *,
    identify: Sequence[str] | None = None,
    period: float,
    forgetting: float | None = None,
    drift: ArrayLike | None = None,
    regularization: ArrayLike = 0.0,
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
        P0=model.parametrize(identify).theta ** 2 / 100,
        period=period,
        forgetting=forgetting,
        drift=drift,
        regularization=regularization,
        bounds=None,
        output=output,
    )
    # in relative parameters, as the design is
    psi = _gradient_along(design.model, design.theta0, u, design.period)
    P = np.diag(_steady(psi, design))
    mean = _mean_diagonal(psi, P, design.forgetting, design.drift, design.regularization)
    return mean * design.scale**2


def _gradient_along(model: Parametrization, theta: Array, u: ArrayLike, period: float) -> Array:
    """Return ψ (N, p) along a torque u (N,), made once for the same axis and torque."""
    return _remembered(pickle.dumps((model, theta, as_torque(u), period)))


def _energy(psi: Array) -> Array:
    return np.maximum(np.mean(psi**2, axis=0), np.finfo(float).tiny)


def _steady(psi: Array, design: Design) -> Array:
    """Return about what P will be (p,), eq. (29) or (30) for one parameter each, to begin from."""
    Q = _energy(psi)
    forgotten = max(1 - design.forgetting, 1 / len(psi))
    return np.where(np.diag(design.drift) > 0, np.sqrt(np.diag(design.drift) / Q), forgotten / Q)


# A benchmark makes each of many estimators anew for every record, all with the same gradient.
@lru_cache(maxsize=32)
def _remembered(content: bytes) -> Array:
    model, theta, u, period = pickle.loads(content)
    return predict(model, theta, u, period=period)[1]


@compiled
def _mean_diagonal(psi, P, forgetting, drift, regularization):
    """Update P along ψ (N, p), eq. (7), (9), (10), (12); return its mean diagonal, second half."""
    N, p = psi.shape
    gain, total = np.empty(p), np.zeros(p)
    for k in range(N):
        s = 1.0
        for i in range(p):
            gain[i] = 0.0
            for j in range(p):
                gain[i] += P[i, j] * psi[k, j]
            s += psi[k, i] * gain[i]
        subtract(P, gain, 1.0 / s)
        for i in range(p):
            for j in range(p):
                P[i, j] = P[i, j] / forgetting + drift[i, j]
        for axis in range(p):  # (12) measures every parameter once, with weight μ
            for i in range(p):
                gain[i] = P[i, axis]
            weight = regularization[axis]
            subtract(P, gain, weight / (1.0 + weight * P[axis, axis]))
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
    Return the diagonal of Δ.

    With a torque, Δ_ii = (T/τ_i)²/Q_ii, Q_ii the mean of ψ_i² along it: estimate i follows with
    the time constant τ_i, whatever the units. τ_i are those that eq. (32) has on the nominal axis,
    where a model moves as that axis does; else their geometric mean. Without, it is eq. (32) on
    the nominal axis, and the same relative to θ on any other.

    Parameters
    ----------
    model : Model
    identify : sequence of str
    period : float
        Sampling period T [s]: Δ is what a sample adds.
    torque : (N,) array_like, optional
        Torque of a nominal run.
    output : {"speed", "increment"}
        What y is.
    """
    theta = model.parametrize(identify).theta
    alike = moves_as(model, AXIS)
    if torque is not None:
        chosen = find_signal(output).predicted(model, period)
        Q = _energy(_gradient_along(chosen.parametrize(identify), theta, torque, period))
        seconds = [FOLLOWS.get(n, FOLLOWS_MEAN) if alike else FOLLOWS_MEAN for n in identify]
        return (period / np.array(seconds)) ** 2 / Q
    paper = np.array([DRIFT.get(name, np.nan) for name in identify])
    unit = theta**2 * (period / PERIOD) ** 2  # with which a time constant stays the same
    if period == PERIOD and is_axis(model, AXIS, identify):
        known = paper  # as it stands there, wherever the estimates start
    elif alike:
        known = paper / named_values(AXIS, identify) ** 2 * unit
    else:
        known = np.full(len(theta), np.nan)
    return np.where(np.isnan(known), RELATIVE_DRIFT * unit, known)


def stored_P(
    model: Model,
    identify: Sequence[str],
    period: float,
    *,
    forgetting: float | None,
    scale: float = 1.0,
) -> Array | None:
    """
    Return `known_P` where it holds: on the nominal axis, in its units and at its period.

    Parameters
    ----------
    model : Model
    identify : sequence of str
    period : float
        Sampling period [s].
    forgetting, scale
        As for `known_P`.

    Returns
    -------
    (p,) array or None
    """
    if period != PERIOD or not is_axis(model, AXIS, identify):
        return None
    return known_P(identify, forgetting=forgetting, scale=scale)


def known_P(names: Sequence[str], *, forgetting: float | None, scale: float = 1.0) -> Array | None:
    """
    Return P(0) of the nominal axis for the paper's three parameters, None for any others.

    In the units and at the period of that axis: `stored_P` asks whether these are given.

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
    from scipy.linalg import sqrtm  # takes a tenth of a second to import

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
    from scipy.linalg import expm

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
