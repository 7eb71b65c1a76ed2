"""
Off-line output-error identification of any parameters, with a verdict on its own result.

Fits the exactly sampled model to a whole record by nonlinear least squares with the analytic
gradient. For white output noise this is the prediction-error method, at its Cramér–Rao bound:
L. Ljung, *System Identification: Theory for the User*, 2nd ed., sections 7.2–7.4, 9.4 and 10.2.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import OptimizeResult, least_squares

from flexaxis.estimators.filters.design import DEFAULT_BOX, finite_vector
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.signals import check_signals

Array = NDArray[np.float64]

COLOURED = 0.1  # correlation of successive residuals that is more than white noise
UNDETERMINED = 0.5  # relative standard deviation of a change that the data do not determine


@dataclass(frozen=True)
class Identified:
    """
    Parameters identified from a record, and how far they can be trusted.

    Attributes
    ----------
    names : tuple of str
        The identified parameters.
    theta : (p,) array
        Their estimates.
    covariance : (p, p) array
        Covariance of the estimates for white output noise; astronomic where the data determine
        nothing.
    correlation : float
        Correlation of successive residuals; near zero if all but white noise is explained.
    condition : float
        Effect on the output of the relative change of the parameters that the data see best, over
        that of the one they see least; a singular problem has 1e10 and more.
    weakest : (p,) array
        Relative change of the parameters, of length one, that the data see least.
    warnings : tuple of str
        What speaks against the result, in words; empty if nothing does.
    """

    names: tuple[str, ...]
    theta: Array
    covariance: Array
    correlation: float
    condition: float
    weakest: Array
    warnings: tuple[str, ...]

    @property
    def standard_deviations(self) -> Array:
        """Standard deviation (p,) of each estimate."""
        return np.sqrt(np.diag(self.covariance))


def output_error(
    model: Model,
    u: ArrayLike,
    y: ArrayLike,
    *,
    identify: Sequence[str],
    start: ArrayLike,
    period: float,
    max_evaluations: int = 60,
) -> Identified:
    """
    Fit parameters to a record that begins at rest.

    Parameters
    ----------
    model : Model
        Linear grey-box model, such as ``three_mass(nominal)``.
    u, y : (N,) array_like
        Torque, and the output measured at the same times.
    identify : sequence of str
        Parameters to fit, or their inverses; all others stay at the model's nominal values.
    start : (p,) array_like
        Where to start; the search goes from a tenth of it to ten times.
    period : float
        Sampling period T [s].
    max_evaluations : int
        Steps after which the search gives up.

    Returns
    -------
    Identified

    Raises
    ------
    EstimatorError
        If an argument cannot be used. A local minimum, or a parameter that the data do not
        determine, is no error: see `Identified.warnings`.

    Notes
    -----
    The misfit has local minima. For the paper's three parameters the search finds the truth from
    0.85 to 1.7 times it; from 0.7 or 2 times it does not, and says so.
    """
    u, y, _ = check_signals(u, y)
    parametrization = model.parametrize(identify)
    initial = finite_vector("start", start, len(parametrization.names))
    misfit, slope = _misfit(parametrization, u, y, period=period, scale=initial)
    search = least_squares(
        misfit, np.ones_like(initial), jac=slope, bounds=DEFAULT_BOX, max_nfev=max_evaluations
    )
    return _result(parametrization.names, initial, search)


def _misfit(
    model: Parametrization, u: Array, y: Array, *, period: float, scale: Array
) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
    """Return ŷ − y and its derivative as functions of θ/scale."""

    @lru_cache(maxsize=1)  # both come from one simulation
    def simulated(x: tuple[float, ...]) -> tuple[Array, Array]:
        predicted, psi = predict(model, np.array(x) * scale, u, period=period)
        return predicted - y, psi * scale

    return (lambda x: simulated(tuple(x))[0]), (lambda x: simulated(tuple(x))[1])


def _result(names: tuple[str, ...], scale: Array, search: OptimizeResult) -> Identified:
    residual, theta = search.fun, search.x * scale
    variance = residual @ residual / (len(residual) - len(names))
    # singular values: what a relative change of the parameters does to the output
    _, singular, changes = np.linalg.svd(search.jac * search.x, full_matrices=False)
    singular = np.maximum(singular, 1e-12 * singular[0])  # smaller ones are rounding
    deviations = np.sqrt(variance) / singular
    correlation = residual[1:] @ residual[:-1] / (residual @ residual)
    weakest = changes[-1] * np.sign(changes[-1][np.argmax(abs(changes[-1]))])
    problems = [
        *_end_of_search(names, search),
        *_colour(float(correlation), len(residual)),
        *_blindness(names, weakest, float(deviations[-1])),
    ]
    return Identified(
        names=names,
        theta=theta,
        covariance=(changes.T * deviations**2) @ changes * np.outer(theta, theta),
        correlation=float(correlation),
        condition=float(singular[0] / singular[-1]),
        weakest=weakest,
        warnings=tuple(problems),
    )


def _end_of_search(names: tuple[str, ...], search: OptimizeResult) -> list[str]:
    stuck = [name for name, side in zip(names, search.active_mask, strict=True) if side]
    problems = [f"{', '.join(stuck)}: at the bound of the search"] if stuck else []
    if search.status == 0:
        problems.append(f"not converged after {search.nfev} evaluations")
    return problems


def _colour(correlation: float, samples: int) -> list[str]:
    if abs(correlation) <= max(COLOURED, 4 / np.sqrt(samples)):
        return []
    return [
        f"successive residuals correlate by {correlation:.2f}, so more than white noise is left: "
        "a local minimum (start elsewhere), or an axis that the model does not describe"
    ]


def _blindness(names: tuple[str, ...], weakest: Array, deviation: float) -> list[str]:
    return [_in_words(names, weakest, deviation)] if deviation > UNDETERMINED else []


def _in_words(names: tuple[str, ...], change: Array, deviation: float) -> str:
    largest = np.abs(change).max()
    proportion = ", ".join(
        f"{name} {share / largest:+.1f} %"
        for name, share in zip(names, change, strict=True)
        if abs(share) > largest / 10
    )
    known = (
        "without any effect on the output, so fix one of them"
        if deviation > 1e3
        else f"known to ±{100 * deviation * largest:.2g} % of the largest"
    )
    return f"seen least is a change in the proportion {proportion}: {known}"
