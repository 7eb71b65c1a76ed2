"""Checked options of a recursive estimator, with default values for missing options."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.signals import counted_angle, find_signal

Array = NDArray[np.float64]

TIME_CONSTANT = 1.0  # s, default time constant of forgetting: λ = 0.995 at a period of 5 ms, as in
# the paper
ANCHOR = 10.0  # rad, standard deviation of the angle before its first reading: much larger than the
# resolution of an encoder, but small enough to avoid rounding errors
DEFAULT_BOX = (0.1, 10.0)  # default bounds, as multiples of θ(0)


@dataclass(frozen=True)
class Design:
    """
    The checked options of a filter for the relative parameters η = θ/θ(0); see `make_design`.

    The initial value of η is one, regardless of the units and signs of θ.

    Attributes
    ----------
    model : Parametrization
        Model of the axis as a function of the relative parameters η, with the selected output
        signal.
    scale : (p,) array
        Ratio of the parameters θ to the relative parameters η. The ratio θ/η is θ(0) unless the
        option ``scale`` of `make_design` is given.
    output : str
        Name of the output signal y, as listed in `flexaxis.estimators.signals.SIGNALS`.
    period : float
        Sampling period [s].
    theta0 : (p,) array
        Initial estimate η(0).
    P0 : (p, p) array
        Initial covariance P(0) of the relative parameters η for a noise variance of one.
    forgetting : float
        Forgetting factor λ of equation (9), or 1 if the filter uses a drift covariance instead.
    drift : (p, p) array
        Drift covariance Δ of equation (10) for the relative parameters η, or zero if the filter
        uses a forgetting factor instead.
    regularization : (p,) array
        Diagonal of the regularisation matrix in equations (11) and (12), for the relative
        parameters η.
    lower, upper : (p,) arrays
        Lower and upper bounds of the relative parameters η.
    noise : float
        Standard deviation of the noise in y, in the unit of y, or 0 if the filter has to estimate
        the noise.
    x0_covariance : (n, n) array
        Covariance of the n states at the first sample. The n states include the states of the
        torque laws, but not the torques of these laws. The initial states have zero mean.
    differences : bool
        Whether the filter converts angle readings to angle increments.
    """

    model: Parametrization
    scale: Array
    output: str
    period: float
    theta0: Array
    P0: Array
    forgetting: float
    drift: Array
    regularization: Array
    lower: Array
    upper: Array
    noise: float
    x0_covariance: Array
    differences: bool


def make_design(
    model: Model,
    *,
    identify: Sequence[str] | None = None,
    theta0: ArrayLike | None = None,
    P0: ArrayLike,
    period: float,
    forgetting: float | None = None,
    drift: ArrayLike | None = None,
    regularization: ArrayLike = 0.0,
    bounds: tuple[ArrayLike, ArrayLike] | None = None,
    output: str = "speed",
    noise: float | None = None,
    x0_variance: ArrayLike = (),
    scale: ArrayLike | None = None,
    corrects: bool = False,
) -> Design:
    """
    Check the options of an estimator and fill in default values.

    The docstring of `flexaxis.estimators.Rpem` describes the remaining parameters.

    Parameters
    ----------
    x0_variance : (n,) array_like, optional
        Variances of the states of ``model`` at the first sample; zero by default.
    scale : (p,) array_like, optional
        Scale that defines the relative parameters η = θ/scale; θ(0) by default. The scale must be
        given if a parameter starts at zero.
    corrects : bool
        Whether the filter corrects its state with the measurements. A filter that corrects its
        state reads angles directly; any other filter reads angle increments.

    Raises
    ------
    EstimatorError
        If an option is invalid; the message states what is allowed.
    """
    above_zero("period", period, "the sampling period [s]")
    counted = corrects and output == "angle"
    differences = output == "angle" and not counted
    chosen = counted_angle(model) if counted else find_signal(output).predicted(model, period)
    if noise is not None:
        above_zero("noise", noise, "the standard deviation of the noise in y")
    sigma = float(noise or 0.0)
    parametrization = chosen.parametrize(model.identify if identify is None else identify)
    p = len(parametrization.names)
    start = finite_vector("theta0", parametrization.theta if theta0 is None else theta0, p)
    lower, upper = _box(start, bounds, np.array(parametrization.additive))
    if forgetting is not None and drift is not None:
        raise EstimatorError("give either the option forgetting or the option drift, not both")
    modification = np.zeros((p, p)) if drift is None else covariance_matrix("drift", drift, p)
    scale = start if scale is None else finite_vector("scale", scale, p)
    if not scale.all():
        raise EstimatorError(
            f"theta0 is {start}, but the scale of a parameter that starts at 0 is unknown; start "
            "the parameter at its expected magnitude"
        )
    lower, upper = np.sort([lower / scale, upper / scale], axis=0)
    squares = np.outer(scale, scale)
    initial = np.zeros(parametrization.states)
    initial[: np.size(x0_variance)] = x0_variance
    if counted:
        initial[len(model.states)] = ANCHOR**2
    return Design(
        model=parametrization.relative(scale),
        scale=scale,
        output=output,
        period=float(period),
        theta0=start / scale,
        P0=covariance_matrix("P0", P0, p) / squares,
        forgetting=forgetting_factor(forgetting, period) if drift is None else 1.0,
        drift=modification / squares,
        regularization=_weights(regularization, p) * scale**2,
        lower=lower,
        upper=upper,
        noise=sigma * np.sqrt(2) / period if differences else sigma,
        x0_covariance=np.diag(initial),
        differences=differences,
    )


def above_zero(name: str, value: object, what: str) -> float:
    """Return a number if it is finite and positive; ``what`` describes it in the error message."""
    if _is_number(value) and 0 < value < np.inf:  # type: ignore[operator]
        return float(value)  # type: ignore[arg-type]
    raise EstimatorError(f"{name} is {value!r}, but {what} must be a finite number above 0")


def at_least_zero(name: str, value: object, what: str) -> float:
    """Return a number if it is finite and ≥ 0; ``what`` describes it in the error message."""
    return (
        0.0
        if _is_number(value) and value == 0
        else above_zero(name, value, f"{what} must be 0, or it")
    )


def flag(name: str, value: object) -> bool:
    """Return the value of a boolean option, or raise EstimatorError if the value is not boolean."""
    if isinstance(value, bool):
        return value
    raise EstimatorError(f"the option {name} is {value!r}, but must be true or false")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)


def forgetting_factor(forgetting: object, period: float) -> float:
    """Check and return the forgetting factor λ; its default time constant is `TIME_CONSTANT`."""
    if forgetting is None:
        return max(1 - period / TIME_CONSTANT, 0.5)
    if _is_number(forgetting) and 0 < forgetting <= 1:  # type: ignore[operator]
        return float(forgetting)  # type: ignore[arg-type]
    raise EstimatorError(f"forgetting is {forgetting!r}, but the factor λ must lie in (0, 1]")


def _weights(regularization: ArrayLike, p: int) -> Array:
    weights = _as_numbers("regularization", regularization) * np.ones(p)
    if not np.all(np.isfinite(weights) & (weights >= 0)):
        raise EstimatorError(
            f"regularization is {regularization!r}, but the weight μ must be finite and ≥ 0"
        )
    return weights


def _as_numbers(name: str, value: ArrayLike) -> Array:
    """Convert the value of an option to a new array of floats."""
    try:
        return np.array(value, float)
    except (TypeError, ValueError):
        raise EstimatorError(f"{name} is {value!r}; give numbers") from None


def finite_vector(name: str, value: ArrayLike, p: int) -> Array:
    """Convert the value of an option to a new array of p finite floats."""
    vector = _as_numbers(name, value)
    if vector.shape != (p,) or not np.all(np.isfinite(vector)):
        raise EstimatorError(
            f"{name} is {value!r}; give {p} finite values, one for each identified parameter"
        )
    return vector


def covariance_matrix(name: str, value: ArrayLike, p: int) -> Array:
    """Check and return a positive definite matrix (p, p), given in full or by its diagonal (p,)."""
    matrix = _as_numbers(name, value)
    if matrix.shape == (p,):
        matrix = np.diag(matrix)
    if matrix.shape != (p, p):
        raise EstimatorError(
            f"{name} has the shape {matrix.shape}, but for {p} parameters the shape must be "
            f"({p},) or ({p}, {p})"
        )
    scale = np.sqrt(np.abs(np.diag(matrix)))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = matrix / np.outer(scale, scale)  # independent of units
    if (
        not np.all(np.isfinite(correlation))
        or not np.allclose(correlation, correlation.T, rtol=0, atol=1e-9)
        or np.linalg.eigvalsh(correlation)[0] < 1e-300
    ):
        raise EstimatorError(
            f"{name} must be symmetric positive definite, but is {matrix.tolist()}"
        )
    return (matrix + matrix.T) / 2


def _box(
    theta0: Array, bounds: tuple[ArrayLike, ArrayLike] | None, additive: NDArray[np.bool_]
) -> tuple[Array, Array]:
    if bounds is None:
        lower, upper = np.sort(np.outer(DEFAULT_BOX, theta0), axis=0)
    else:
        lower, upper = (finite_vector("bounds", bound, len(theta0)) for bound in bounds)
    if np.any((lower * upper <= 0) & ~additive):
        raise EstimatorError(
            f"the bounds {lower} to {upper} contain zero, but a physical parameter cannot change "
            "its sign; give two bounds with the same sign (and a nonzero initial value)"
        )
    if np.any(theta0 < lower) or np.any(theta0 > upper):
        raise EstimatorError(f"the bounds {lower} to {upper} do not enclose theta0 = {theta0}")
    return lower, upper
