"""
The interface of an estimator, and the report of a detected change.

The protocol is structural, so a user's class does not have to import anything from this package.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.signals import check_signals


class StepError(EstimatorError):
    """Error for an estimator that does not return one number for each name."""


@runtime_checkable
class Estimator(Protocol):
    """
    Any object with the attributes ``names`` and ``output`` and the method ``step``.

    Optional methods and attributes: ``run(u, y, valid=None) -> (N, p)``, a faster equivalent of N
    steps; ``covariance`` (p, p); ``innovations`` (N, 2), the innovation y − ŷ and its claimed
    variance for each sample of the last ``run`` (NaN where y was missing); ``alarm`` (bool);
    ``findings``, a sequence of objects with ``alarm`` (sample) and ``parameters`` (names of the
    changed parameters); ``reset()``.

    Attributes
    ----------
    names : sequence of str
        Names of the parameters θ, in the order of the estimates.
    output : str
        Name of the signal y in `flexaxis.estimators.signals.SIGNALS`.
    """

    @property
    def names(self) -> Sequence[str]: ...  # noqa: D102

    @property
    def output(self) -> str: ...  # noqa: D102

    def step(self, u: float, y: float | None) -> ArrayLike:
        """Process u[k] and y[k] (None in a gap) and return θ[k] (p,); u[k] first affects y[k+1]."""


@dataclass(frozen=True)
class Finding:
    """
    A detected change.

    Attributes
    ----------
    alarm : int
        Index of the sample at which the change was detected.
    onset : int
        Index of the last sample with the old parameters.
    parameters : tuple of str
        Names of the changed parameters; empty if no hypothesis explains the change.
    ratio : tuple of float
        New value divided by the old value, for each parameter.
    reason : str
        Reason why ``parameters`` is empty; an empty string otherwise.
    interval : tuple of (float, float)
        95 % confidence interval of each ratio; empty if the estimator claims none.
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
    Run an estimator over N samples with its own ``run`` if available, otherwise step by step.

    Parameters
    ----------
    estimator : Estimator
        Estimator to run. Afterwards it is in the state after the last sample.
    u, y : (N,) array_like
        Torque and measured output.
    valid : (N,) array_like of bool, optional
        False where y is missing; True everywhere by default.

    Returns
    -------
    (N, p) array
        Estimates θ[0], θ[1], …

    Raises
    ------
    EstimatorError
        If the signals are invalid, or the estimator does not return numbers.
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
    Convert the result of an estimator's step to floats, one for each name.

    Parameters
    ----------
    returned : (p,) array_like
        Result of a step; may be a scalar if p is 1.
    names : sequence of str
        Names of the p parameters.
    estimator : Estimator
        Estimator that returned the result, used in the message.

    Returns
    -------
    (p,) array

    Raises
    ------
    StepError
        If the result is not numeric, or has the wrong number of values.
    """
    theta = numbers_of(returned, estimator.step)
    if returned is not None and theta.size == len(names):
        return theta.reshape(-1)
    several = "nothing" if returned is None else f"{theta.size} number{'s'[: theta.size != 1]}"
    told = f"step returned {several}, names has {len(names)}: {', '.join(names)}"
    raise StepError(told + _place(estimator.step))


def numbers_of(returned: ArrayLike, call: Callable[..., object]) -> NDArray[np.float64]:
    """
    Convert the result of a call to floats, with NaN for masked elements.

    Parameters
    ----------
    returned : array_like
        Result of the call.
    call : callable
        Function that returned the result, used in the message.

    Raises
    ------
    StepError
        If the result is not numeric.
    """
    try:
        return np.asarray(np.ma.filled(returned, np.nan), float)
    except (TypeError, ValueError) as error:
        name = getattr(call, "__name__", "it")
        raise StepError(f"{name} returned no numbers: {error}{_place(call)}") from None


def _place(call: Callable[..., object]) -> str:
    code = getattr(getattr(call, "__func__", call), "__code__", None)
    return f" ({code.co_filename}:{code.co_firstlineno})" if code else ""
