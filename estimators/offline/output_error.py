"""
Off-line output-error identification of model parameters, with checks of the estimates.

Nonlinear least squares with an analytic gradient fits the exactly sampled model to a whole record.
For white output noise, the fit is a prediction-error method and attains the Cramér–Rao bound.
Sections 7.2–7.4, 9.4 and 10.2 of Ljung's *System Identification* (2nd edition) describe
prediction-error methods.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import OptimizeResult, least_squares

from flexaxis.estimators.filters.design import DEFAULT_BOX, finite_vector
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.signals import check_signals

Array = NDArray[np.float64]

COLOURED = 0.1  # correlation of successive residuals above which residuals are not white noise
UNDETERMINED = 0.5  # relative standard deviation above which the data do not determine a change


@dataclass(frozen=True)
class Identified:
    """
    Parameters that were identified from a record, and measures of their reliability.

    Attributes
    ----------
    names : tuple of str
        Names of the identified parameters.
    theta : (p,) array
        Estimated parameter values.
    covariance : (p, p) array
        Covariance of the parameter estimates for white output noise. The covariance is extremely
        large for parameters that the data do not determine.
    correlation : float
        Correlation of successive residuals, which is near zero if the residuals are white noise.
    condition : float
        Condition number of the fit. The condition number is the largest effect that a relative
        parameter change of a given size has on the output, divided by the smallest such effect. A
        condition number of 1e10 or more indicates a singular problem.
    warnings : tuple of str
        Reasons to doubt the estimates, in words. The tuple is empty if there is no reason to doubt
        the estimates.
    """

    names: tuple[str, ...]
    theta: Array
    covariance: Array
    correlation: float
    condition: float
    warnings: tuple[str, ...]

    @property
    def standard_deviations(self) -> Array:
        """Standard deviations of the estimates (p,)."""
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
    Fit model parameters to a record of an axis that is initially at rest.

    Parameters
    ----------
    model : Model
        Linear grey-box model, such as ``three_mass(nominal)``.
    u, y : (N,) array_like
        Torque, and the output that was measured at the same times.
    identify : sequence of str
        Names of the fitted parameters or inverse parameters. All other parameters keep the nominal
        values of the model.
    start : (p,) array_like
        Initial parameter values. The search is limited to the range from 0.1 to 10 times the
        initial values.
    period : float
        Sampling period T [s].
    max_evaluations : int
        Largest number of model evaluations before the search stops.

    Raises
    ------
    EstimatorError
        If an argument is invalid. A local minimum or an undetermined parameter does not raise an
        error, but adds a message to `Identified.warnings`.

    Notes
    -----
    The sum of squared residuals has local minima. For the three parameters of Östring and
    Gunnarsson, a search that starts at 0.85 to 1.7 times the true values finds the true values. A
    search that starts at 0.7 or 2 times the true values does not find the true values, but returns
    a warning.
    """
    u, y, _ = check_signals(u, y)
    chosen = model.parametrize(identify)
    scale = finite_vector("start", start, len(chosen.names))

    @lru_cache(maxsize=1)  # one simulation computes both the misfit and its slope
    def simulated(x: tuple[float, ...]) -> tuple[Array, Array]:
        predicted, psi = predict(chosen, np.array(x) * scale, u, period=period)
        return predicted - y, psi * scale

    search = least_squares(
        lambda x: simulated(tuple(x))[0],
        np.ones(len(scale)),
        jac=lambda x: simulated(tuple(x))[1],
        bounds=DEFAULT_BOX,
        max_nfev=max_evaluations,
    )
    return _result(chosen.names, scale, search)


def _result(names: tuple[str, ...], scale: Array, search: OptimizeResult) -> Identified:
    residual, theta = search.fun, search.x * scale
    variance = residual @ residual / (len(residual) - len(names))
    # singular values: effects of relative changes of the parameters on the output
    _, singular, changes = np.linalg.svd(search.jac * search.x, full_matrices=False)
    singular = np.maximum(singular, 1e-12 * singular[0])  # smaller values are rounding errors
    deviations = np.sqrt(variance) / singular
    correlation = float(residual[1:] @ residual[:-1] / (residual @ residual))
    problems = [
        f"the estimate of {name} is at a limit of the search range, 0.1 or 10 times the start value"
        for name, side in zip(names, search.active_mask, strict=True)
        if side
    ]
    if search.status == 0:
        problems.append(f"the search did not converge in {search.nfev} model evaluations")
    if abs(correlation) > max(COLOURED, 4 / np.sqrt(len(residual))):
        problems.append(
            f"successive residuals have the correlation {correlation:.2f}, so the residuals are "
            "not white noise; either the search ended in a local minimum (try other initial "
            "values), or the model does not describe the axis"
        )
    if deviations[-1] > UNDETERMINED:
        share = changes[-1] / changes[-1][np.argmax(abs(changes[-1]))]
        parts = [f"{n} {x:+.1f} %" for n, x in zip(names, share, strict=True) if abs(x) > 0.1]
        problems.append(
            f"a combined change of {', '.join(parts)} hardly affects the output; fix one of these "
            "parameters at its nominal value"
        )
    return Identified(
        names=names,
        theta=theta,
        covariance=(changes.T * deviations**2) @ changes * np.outer(theta, theta),
        correlation=correlation,
        condition=float(singular[0] / singular[-1]),
        warnings=tuple(problems),
    )
