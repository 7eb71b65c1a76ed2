"""The options of a recursive estimator, checked once and with defaults filled in."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.signals import counted_angle, find_signal

Array = NDArray[np.float64]

TIME_CONSTANT = 1.0  # s, of forgetting by default; λ = 0.995 at 5 ms, as in the paper
ANCHOR = 10.0  # rad, standard deviation of the angle before its first reading: far more than an
# encoder resolves, and little enough for the arithmetic
DEFAULT_BOX = (0.1, 10.0)  # times θ(0)


@dataclass(frozen=True)
class Design:
    """
    The checked options of a filter, in relative parameters η = θ/θ(0); made by `make_design`.

    In η a filter starts at one, whatever the units and signs of θ are.

    Attributes
    ----------
    model : Parametrization
        The model as a function of η, its output as chosen.
    scale : (p,) array
        θ(0), by which η is multiplied to give θ; ones for a design in θ itself.
    output : str
        Name of the signal y in `flexaxis.estimators.signals.SIGNALS`.
    period : float
        Sampling period [s].
    theta0 : (p,) array
        η(0).
    P0 : (p, p) array
        P(0) of η, for a noise variance of one.
    forgetting : float
        λ of eq. (9); one with covariance modification.
    drift : (p, p) array
        Δ of eq. (10), for η; zero with forgetting.
    regularization : (p,) array
        Diagonal of μ I of eq. (11), (12), for η.
    lower, upper : (p,) arrays
        The box on which η is projected.
    noise : float
        Standard deviation of y, in its unit; 0 if it has to be estimated.
    x0_covariance : (n, n) array
        Covariance of the state at the first sample, without the torques of laws. The state itself
        is zero.
    differences : bool
        Whether the filter converts angles to increments.
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

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.model.names

    @property
    def bounds(self) -> tuple[Array, Array]:
        """The box of θ."""
        sides = self.lower * self.scale, self.upper * self.scale
        return np.minimum(*sides), np.maximum(*sides)


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
    Check the options of `flexaxis.estimators.Rpem`, which explains them, and fill in defaults.

    Parameters
    ----------
    x0_variance : (n,) array_like, optional
        Variances of the states of ``model`` at the first sample; zero by default.
    scale : (p,) array_like, optional
        Divides θ instead of θ(0), for parameters of laws that start at zero.
    corrects : bool
        Whether the filter corrects its state. If so, it reads angles directly; otherwise it reads
        their increments.

    Raises
    ------
    EstimatorError
        On the first option that cannot be used, saying what would be allowed.
    """
    above_zero("period", period, "the sampling period in seconds")
    counted, differences = output == "angle" and corrects, output == "angle" and not corrects
    chosen = find_signal(output).predicted(model, period)
    chosen = counted_angle(model) if counted else chosen
    sigma = 0.0 if noise is None else above_zero("noise", noise, "the standard deviation of y")
    parametrization = chosen.parametrize(model.identify if identify is None else identify)
    p = len(parametrization.names)
    start = finite_vector("theta0", parametrization.theta if theta0 is None else theta0, p)
    lower, upper = _box(start, bounds, np.array(parametrization.additive))
    weight, modification = _time_update(forgetting, drift, period, p)
    scale = _scale(start, scale)
    sides = lower / scale, upper / scale
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
        forgetting=weight,
        drift=modification / squares,
        regularization=_weights(regularization, p) * scale**2,
        lower=np.minimum(*sides),
        upper=np.maximum(*sides),
        noise=sigma * np.sqrt(2) / period if differences else sigma,
        x0_covariance=np.diag(initial),
        differences=differences,
    )


def _scale(start: Array, asked: ArrayLike | None) -> Array:
    scale = start if asked is None else finite_vector("scale", asked, len(start))
    if not scale.all():
        raise EstimatorError(
            f"a parameter of a law starts at 0 ({start}), which gives it no scale: start it at the "
            "size that it may have"
        )
    return scale


def above_zero(name: str, value: object, what: str) -> float:
    """Return a finite number above zero; ``what`` says what it is, and its unit."""
    if _is_number(value) and 0 < value < np.inf:  # type: ignore[operator]
        return float(value)  # type: ignore[arg-type]
    raise EstimatorError(f"{name} is {value!r}; give {what}, finite and above 0")


def at_least_zero(name: str, value: object, what: str) -> float:
    """Return a finite number that is not negative; ``what`` says what it is, and its unit."""
    return 0.0 if _is_number(value) and value == 0 else above_zero(name, value, f"0 or {what}")


def flag(name: str, value: object) -> bool:
    """Return a value that is True or False."""
    if isinstance(value, bool):
        return value
    raise EstimatorError(f"{name} is {value!r}; give true or false")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)


def forgetting_factor(forgetting: object, period: float) -> float:
    """Return λ in (0, 1], by default that of `TIME_CONSTANT`."""
    if forgetting is None:
        return max(1 - period / TIME_CONSTANT, 0.5)
    if _is_number(forgetting) and 0 < forgetting <= 1:  # type: ignore[operator]
        return float(forgetting)  # type: ignore[arg-type]
    raise EstimatorError(f"forgetting is {forgetting!r}; λ must lie in (0, 1]")


def _time_update(
    forgetting: float | None, drift: ArrayLike | None, period: float, p: int
) -> tuple[float, Array]:
    if forgetting is not None and drift is not None:
        raise EstimatorError("forgetting and drift are both given; choose (9) or (10), not both")
    if drift is not None:
        return 1.0, covariance_matrix("drift", drift, p)
    return forgetting_factor(forgetting, period), np.zeros((p, p))


def _weights(regularization: ArrayLike, p: int) -> Array:
    weights = _as_numbers("regularization", regularization) * np.ones(p)
    if not np.all(np.isfinite(weights) & (weights >= 0)):
        raise EstimatorError(f"regularization is {regularization!r}; μ must be finite and ≥ 0")
    return weights


def _as_numbers(name: str, value: ArrayLike) -> Array:
    """Return a new array of floats."""
    try:
        return np.array(value, float)
    except (TypeError, ValueError):
        raise EstimatorError(f"{name} is {value!r}; give numbers") from None


def finite_vector(name: str, value: ArrayLike, p: int) -> Array:
    """Return a new finite (p,) array."""
    vector = _as_numbers(name, value)
    if vector.shape != (p,) or not np.all(np.isfinite(vector)):
        raise EstimatorError(
            f"{name} is {value!r}; give {p} finite values, one for each identified parameter"
        )
    return vector


def covariance_matrix(name: str, value: ArrayLike, p: int) -> Array:
    """Return a symmetric positive definite (p, p) matrix from that or from its diagonal (p,)."""
    matrix = _as_numbers(name, value)
    if matrix.shape == (p,):
        matrix = np.diag(matrix)
    if matrix.shape != (p, p):
        raise EstimatorError(
            f"{name} has the shape {matrix.shape}; for {p} parameters give ({p},) or ({p}, {p})"
        )
    scale = np.sqrt(np.abs(np.diag(matrix)))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = matrix / np.outer(scale, scale)  # judged free of units
    if (
        not np.all(np.isfinite(correlation))
        or not np.allclose(correlation, correlation.T, rtol=0, atol=1e-9)
        or np.linalg.eigvalsh(correlation)[0] < 1e-300
    ):
        raise EstimatorError(
            f"{name} must be symmetric positive definite; given: {matrix.tolist()}"
        )
    return (matrix + matrix.T) / 2


def _box(
    theta0: Array, bounds: tuple[ArrayLike, ArrayLike] | None, additive: NDArray[np.bool_]
) -> tuple[Array, Array]:
    if bounds is None:
        corners = np.outer(DEFAULT_BOX, theta0)
        lower, upper = corners.min(axis=0), corners.max(axis=0)
    else:
        lower, upper = (finite_vector("bounds", bound, len(theta0)) for bound in bounds)
    if np.any((lower * upper <= 0) & ~additive):
        raise EstimatorError(
            f"bounds {lower} … {upper} contain zero; a physical parameter keeps its sign, so give "
            "bounds on one side of zero (and a start that is not zero)"
        )
    if np.any(theta0 < lower) or np.any(theta0 > upper):
        raise EstimatorError(f"bounds {lower} … {upper} do not enclose theta0 = {theta0}")
    return lower, upper
