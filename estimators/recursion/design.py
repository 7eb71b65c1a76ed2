"""The options of a recursive prediction-error method, checked once and with defaults filled in."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.models.model import Model, Parametrization, increment

Array = NDArray[np.float64]

OUTPUTS = ("speed", "increment")
DEFAULT_FORGETTING = 0.995
DEFAULT_BOX = (0.1, 10.0)  # times θ(0)


@dataclass(frozen=True)
class Design:
    """
    What a filter is to do; made by `make_design`.

    Attributes
    ----------
    model : Parametrization
        The model as a function of θ, its output as chosen.
    output : str
        ``"speed"`` or ``"increment"``.
    period : float
        Sampling period [s].
    theta0 : (p,) array
        θ(0).
    P0 : (p, p) array
        P(0), for a noise variance of one.
    forgetting : float
        λ of eq. (9); one where P is modified by Δ.
    drift : (p, p) array
        Δ of eq. (10); zero where P is forgotten.
    regularization : float
        μ of eq. (11), (12).
    lower, upper : (p,) arrays
        The box on which θ is projected.
    """

    model: Parametrization
    output: str
    period: float
    theta0: Array
    P0: Array
    forgetting: float
    drift: Array
    regularization: float
    lower: Array
    upper: Array


def make_design(
    model: Model,
    *,
    identify: Sequence[str],
    theta0: ArrayLike | None,
    P0: ArrayLike,
    period: float,
    forgetting: float | None,
    drift: ArrayLike | None,
    regularization: float,
    bounds: tuple[ArrayLike, ArrayLike] | None,
    output: str,
) -> Design:
    """
    Check the options of `flexaxis.estimators.Rpem`, which explains them, and fill in defaults.

    Raises
    ------
    EstimatorError
        On the first option that cannot be used, saying what would be allowed.
    """
    if output not in OUTPUTS:
        raise EstimatorError(f"unknown output {output!r}: {did_you_mean(str(output), OUTPUTS)}")
    if not (np.isfinite(period) and period > 0):
        raise EstimatorError(f"period is {period}; give the sampling period in seconds, above 0")
    chosen = increment(model, period) if output == "increment" else model
    parametrization = chosen.parametrize(identify)
    p = len(parametrization.names)
    start = finite_vector("theta0", parametrization.theta if theta0 is None else theta0, p)
    lower, upper = _box(start, bounds)
    weight, modification = _time_update(forgetting, drift, p)
    if not (np.isfinite(regularization) and regularization >= 0):
        raise EstimatorError(f"regularization is {regularization}; μ must be finite and ≥ 0")
    return Design(
        model=parametrization,
        output=output,
        period=float(period),
        theta0=start,
        P0=covariance_matrix("P0", P0, p),
        forgetting=weight,
        drift=modification,
        regularization=float(regularization),
        lower=lower,
        upper=upper,
    )


def _time_update(forgetting: float | None, drift: ArrayLike | None, p: int) -> tuple[float, Array]:
    if forgetting is not None and drift is not None:
        raise EstimatorError("forgetting and drift are both given; choose (9) or (10), not both")
    if drift is not None:
        return 1.0, covariance_matrix("drift", drift, p)
    weight = DEFAULT_FORGETTING if forgetting is None else forgetting
    if not 0 < weight <= 1:
        raise EstimatorError(f"forgetting is {weight}; λ must lie in (0, 1]")
    return float(weight), np.zeros((p, p))


def finite_vector(name: str, value: ArrayLike, p: int) -> Array:
    """Return a finite (p,) array, a copy of what is given."""
    vector = np.array(value, float)
    if vector.shape != (p,) or not np.all(np.isfinite(vector)):
        raise EstimatorError(
            f"{name} is {value!r}; give {p} finite values, one for each identified parameter"
        )
    return vector


def covariance_matrix(name: str, value: ArrayLike, p: int) -> Array:
    """Return a symmetric positive definite (p, p) matrix from that or from its diagonal (p,)."""
    matrix = np.array(value, float)
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
        or np.linalg.eigvalsh(correlation)[0] <= 0
    ):
        raise EstimatorError(
            f"{name} must be symmetric positive definite; given: {matrix.tolist()}"
        )
    return (matrix + matrix.T) / 2


def _box(theta0: Array, bounds: tuple[ArrayLike, ArrayLike] | None) -> tuple[Array, Array]:
    if bounds is None:
        corners = np.outer(DEFAULT_BOX, theta0)
        lower, upper = corners.min(axis=0), corners.max(axis=0)
    else:
        lower, upper = (finite_vector("bounds", bound, len(theta0)) for bound in bounds)
    if np.any(lower * upper <= 0):
        raise EstimatorError(
            f"bounds {lower} … {upper} contain zero; a physical parameter keeps its sign, so give "
            "bounds on one side of zero (and a start that is not zero)"
        )
    if np.any(theta0 < lower) or np.any(theta0 > upper):
        raise EstimatorError(f"bounds {lower} … {upper} do not enclose theta0 = {theta0}")
    return lower, upper
