"""
The interface of an estimator, and the report of a detected parameter change.

`Estimator` is a structural protocol, so a user-written estimator class does not have to import the
package.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.signals import check_signals


class StepError(EstimatorError):
    """Error for an estimator that does not return exactly one number for each parameter name."""


@runtime_checkable
class Estimator(Protocol):
    """
    Any estimator object with the attributes ``names`` and ``output`` and the method ``step``.

    An estimator can also have the following methods and attributes. The method ``run(u, y,
    valid=None)`` returns an (N, p) array and is a faster equivalent of N calls of ``step``. The
    method ``reset()`` restores the initial state. The attribute ``covariance`` (p, p) is the
    claimed covariance of the estimate. The attribute ``innovations`` (N, 2) contains the innovation
    y − ŷ and its claimed variance for each sample of the last ``run``, or NaN where y was missing.
    The attribute ``alarm`` (bool) is True if the estimator detected a change in the last sample.
    The attribute ``findings`` is a sequence of objects with the attributes ``alarm`` (sample index)
    and ``parameters`` (names of the changed parameters).

    Attributes
    ----------
    names : sequence of str
        Names of the parameters θ, in the order in which ``step`` returns the estimates.
    output : str
        Name of the output signal y, as listed in `flexaxis.estimators.signals.SIGNALS`.
    """

    @property
    def names(self) -> Sequence[str]: ...  # noqa: D102

    @property
    def output(self) -> str: ...  # noqa: D102

    def step(self, u: float, y: float | None) -> ArrayLike:
        """Process u[k] and y[k], and return the estimate θ[k] (p,); in a gap, y is None."""


@dataclass(frozen=True)
class Finding:
    """
    The report of a detected parameter change.

    Attributes
    ----------
    alarm : int
        Index of the sample at which the estimator detected the change.
    onset : int
        Index of the last sample before the parameter change.
    parameters : tuple of str
        Names of the changed parameters, or an empty tuple if the estimator cannot attribute the
        change to a parameter.
    ratio : tuple of float
        For each changed parameter, the new value divided by the old value. The ratio of the new to
        the old value is NaN if the old value does not differ clearly from zero.
    reason : str
        Reason why ``parameters`` is empty, or an empty string if ``parameters`` is not empty.
    interval : tuple of (float, float)
        95 % confidence interval for each element of ``ratio``, or an empty tuple if the estimator
        claims no interval.
    """

    alarm: int
    onset: int
    parameters: tuple[str, ...]
    ratio: tuple[float, ...]
    reason: str = ""
    interval: tuple[tuple[float, float], ...] = ()


def run_estimator(
    estimator: Estimator, u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None
) -> NDArray[np.float64]:
    """
    Run an estimator over N samples with its method ``run``, or with ``step`` if it has no ``run``.

    Parameters
    ----------
    estimator : Estimator
        Estimator that processes the samples. The call changes the state of the estimator to that
        after the last sample.
    u, y : (N,) array_like
        Motor torque and measured output.
    valid : (N,) array_like of bool, optional
        Mask that is False where y is missing; by default, y is valid in all samples.

    Returns
    -------
    (N, p) array
        Parameter estimates θ[0], θ[1], … after each sample.

    Raises
    ------
    EstimatorError
        If the signals are invalid, or if the estimator does not return numbers.
    """
    u, y, present = check_signals(u, y, valid)
    run = getattr(estimator, "run", None)
    if run is not None:
        missing = () if present.all() else (present,)  # a user's `run` may not support gaps
        return numbers_of(run(u, y, *missing), run)
    names = tuple(estimator.names)
    estimates, k = np.empty((len(u), len(names))), 0
    try:
        for k in range(len(u)):
            theta = estimator.step(float(u[k]), float(y[k]) if present[k] else None)
            estimates[k] = theta_of(theta, names, estimator)
    except BaseException as error:
        error.at_sample = k  # type: ignore[attr-defined]  # for the error message
        raise
    return estimates


def theta_of(
    returned: ArrayLike, names: Sequence[str], estimator: Estimator
) -> NDArray[np.float64]:
    """
    Convert the value returned by an estimator's ``step`` to one float for each parameter.

    Parameters
    ----------
    returned : (p,) array_like
        Value returned by ``step``, which can be a scalar if p is 1.
    names : sequence of str
        Names of the p estimated parameters.
    estimator : Estimator
        Estimator that returned the value; the error message gives the file and line of its method
        ``step``.

    Returns
    -------
    (p,) array

    Raises
    ------
    StepError
        If the returned value is not numeric, or has the wrong number of elements.
    """
    theta = numbers_of(returned, estimator.step)
    if returned is not None and theta.size == len(names):
        return theta.reshape(-1)
    several = "nothing" if returned is None else f"{theta.size} number{'s'[: theta.size != 1]}"
    told = f"step returned {several}, but `names` contains {len(names)}: {', '.join(names)}"
    raise StepError(told + _place(estimator.step))


def numbers_of(returned: ArrayLike, call: Callable[..., object]) -> NDArray[np.float64]:
    """
    Convert the return value of a function to floats, with NaN for masked elements.

    Parameters
    ----------
    returned : array_like
        Value that the user's function returned.
    call : callable
        Function that returned the value; the error message names this function.

    Raises
    ------
    StepError
        If the returned value is not numeric.
    """
    try:
        return np.asarray(np.ma.filled(returned, np.nan), float)
    except (TypeError, ValueError) as error:
        name = getattr(call, "__name__", "it")
        raise StepError(f"{name} returned no numbers: {error}{_place(call)}") from None


def _place(call: Callable[..., object]) -> str:
    code = getattr(getattr(call, "__func__", call), "__code__", None)
    return f" ({code.co_filename}:{code.co_firstlineno})" if code else ""
