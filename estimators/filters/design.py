"""The options of a recursive estimator, checked once and with defaults filled in."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.signals import find_signal

Array = NDArray[np.float64]

TIME_CONSTANT = 1.0  # s, of forgetting where nothing is said; λ = 0.995 at 5 ms, as in the paper
DEFAULT_BOX = (0.1, 10.0)  # times θ(0)


@dataclass(frozen=True)
class Design:
    """
    What a filter is to do, in relative parameters η = θ/θ(0); made by `make_design`.

    In η a filter starts at one, whatever the units and signs of θ are.

    Attributes
    ----------
    model : Parametrization
        The model as a function of η, its output as chosen.
    scale : (p,) array
        θ(0), by which η is multiplied to give θ; ones for a design in θ itself.
    output : str
        What y is, of `flexaxis.estimators.signals.SIGNALS`: such as ``"speed"``.
    period : float
        Sampling period [s].
    theta0 : (p,) array
        η(0).
    P0 : (p, p) array
        P(0) of η, for a noise variance of one.
    forgetting : float
        λ of eq. (9); one where P is modified by Δ.
    drift : (p, p) array
        Δ of eq. (10), for η; zero where P is forgotten.
    regularization : (p,) array
        Diagonal of μ I of eq. (11), (12), for η.
    lower, upper : (p,) arrays
        The box on which η is projected.
    noise : float
        Standard deviation of y, in its unit; 0 where it has to be estimated.
    x0 : (n,) array
        State before the first sample.
    x0_covariance : (n, n) array
        Its covariance, of the states but for the torques of laws.
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
    x0: Array
    x0_covariance: Array

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
    x0: ArrayLike | None = None,
    x0_covariance: ArrayLike | None = None,
    scale: ArrayLike | None = None,
) -> Design:
    """
    Check the options of `flexaxis.estimators.Rpem`, which explains them, and fill in defaults.

    Parameters
    ----------
    x0_covariance : (n,) or (n, n) array_like, optional
        Covariance of the state at the first sample; zero, certain, by default. As in ``x0``, states
        that laws have, or that are zero at the start of every sample, need not be given.
    scale : (p,) array_like, optional
        By what θ is divided in the place of θ(0): needed where parameters of laws start at zero.

    Raises
    ------
    EstimatorError
        On the first option that cannot be used, saying what would be allowed.
    """
    above_zero("period", period, "the sampling period in seconds")
    chosen = find_signal(output).predicted(model, period)
    parametrization = chosen.parametrize(model.identify if identify is None else identify)
    p = len(parametrization.names)
    start = finite_vector("theta0", parametrization.theta if theta0 is None else theta0, p)
    lower, upper = _box(start, bounds, np.array(parametrization.additive))
    weight, modification = _time_update(forgetting, drift, period, p)
    scale = _scale(start, scale)
    sides = lower / scale, upper / scale
    squares = np.outer(scale, scale)
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
        noise=0.0 if noise is None else above_zero("noise", noise, "the standard deviation of y"),
        x0=_state("x0", x0, parametrization),
        x0_covariance=_state_covariance(x0_covariance, parametrization),
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
    if _is_number(value) and np.isfinite(value) and value > 0:  # type: ignore[call-overload, operator]
        return float(value)  # type: ignore[arg-type]
    raise EstimatorError(f"{name} is {value!r}; give {what}, finite and above 0")


def at_least_zero(name: str, value: object, what: str) -> float:
    """Return a finite number that is not negative; ``what`` says what it is, and its unit."""
    if _is_number(value) and np.isfinite(value) and value >= 0:  # type: ignore[call-overload, operator]
        return float(value)  # type: ignore[arg-type]
    raise EstimatorError(f"{name} is {value!r}; give {what}, finite and not negative")


def flag(name: str, value: object) -> bool:
    """Return a truth that is one."""
    if isinstance(value, bool):
        return value
    raise EstimatorError(f"{name} is {value!r}; give true or false")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)


def forgetting_factor(forgetting: object, period: float) -> float:
    """Return λ in (0, 1]; where none is given, that of a time constant of `TIME_CONSTANT`."""
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
    weights = _as_numbers("regularization", regularization)
    if weights.shape not in {(), (p,)} or not np.all(np.isfinite(weights) & (weights >= 0)):
        raise EstimatorError(f"regularization is {regularization!r}; μ must be finite and ≥ 0")
    return np.broadcast_to(weights, (p,)).copy()


def _state(name: str, value: ArrayLike | None, model: Parametrization) -> Array:
    state = np.zeros(model.n) if value is None else np.array(value, float)
    if state.shape == (model.own_states,):
        # states that are zero when a sample begins, or that laws have, come last, and need not be
        # given
        state = np.concatenate([state, np.zeros(model.n - model.own_states)])
    if state.shape != (model.n,) or not np.all(np.isfinite(state)):
        raise EstimatorError(
            f"{name} is {value!r}; give {model.own_states} finite values, one a state"
        )
    return state


def _state_covariance(value: ArrayLike | None, model: Parametrization) -> Array:
    P, n = np.zeros((model.states, model.states)), model.own_states
    if value is not None:
        P[:n, :n] = covariance_matrix("x0_covariance", value, n, certain=True, what="states")
    return P


def _as_numbers(name: str, value: ArrayLike) -> Array:
    """Return an array of floats, a copy of what is given."""
    try:
        return np.array(value, float)
    except (TypeError, ValueError):
        raise EstimatorError(f"{name} is {value!r}; give numbers") from None


def finite_vector(name: str, value: ArrayLike, p: int) -> Array:
    """Return a finite (p,) array, a copy of what is given."""
    vector = _as_numbers(name, value)
    if vector.shape != (p,) or not np.all(np.isfinite(vector)):
        raise EstimatorError(
            f"{name} is {value!r}; give {p} finite values, one for each identified parameter"
        )
    return vector


def covariance_matrix(
    name: str, value: ArrayLike, n: int, *, certain: bool = False, what: str = "parameters"
) -> Array:
    """
    Return a symmetric positive definite (n, n) matrix from that or from its diagonal (n,).

    Where something may be ``certain``, it only has no negative eigenvalues.
    """
    matrix = _as_numbers(name, value)
    if matrix.shape == (n,):
        matrix = np.diag(matrix)
    if matrix.shape != (n, n):
        raise EstimatorError(
            f"{name} has the shape {matrix.shape}; for {n} {what} give ({n},) or ({n}, {n})"
        )
    variances = np.diag(matrix)
    scale = np.sqrt(np.abs(np.where(certain & (variances == 0), 1.0, variances)))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = matrix / np.outer(scale, scale)  # judged free of units
    if (
        not np.all(np.isfinite(correlation))
        or not np.allclose(correlation, correlation.T, rtol=0, atol=1e-9)
        or np.linalg.eigvalsh(correlation)[0] < (-1e-9 if certain else 1e-300)
    ):
        words = "symmetric and not negative" if certain else "symmetric positive definite"
        raise EstimatorError(f"{name} must be {words}; given: {matrix.tolist()}")
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
