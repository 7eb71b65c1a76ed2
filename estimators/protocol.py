"""
What an estimator is, and how it reports a change.

The protocol is structural, so that a user's class imports nothing of ours.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.signals import check_signals


class StepError(EstimatorError):
    """An estimator returned something other than one number for each name."""


@runtime_checkable
class Estimator(Protocol):
    """
    Anything with names, an output and a step.

    Optional: ``run(u, y, valid=None) -> (N, p)``, the same numbers faster; ``covariance`` (p, p);
    ``innovations`` (N, 2), y − ŷ of each sample of the last ``run`` and its claimed variance, NaN
    where there was no y; ``alarm`` (bool); ``findings``, a sequence of objects with ``alarm``
    (sample) and ``parameters`` (names of what has changed); ``reset()``.

    Attributes
    ----------
    names : sequence of str
        The meaning of θ, in this order.
    output : str
        The signal that it reads, a name in `flexaxis.estimators.signals.SIGNALS`.
    """

    @property
    def names(self) -> Sequence[str]: ...  # noqa: D102

    @property
    def output(self) -> str: ...  # noqa: D102

    def step(self, u: float, y: float | None) -> ArrayLike:
        """Take u[k] and y[k] (None in a gap), return θ[k] (p,); u[k] first acts on y[k+1]."""


@dataclass(frozen=True)
class Finding:
    """
    A detected change.

    Attributes
    ----------
    alarm : int
        Sample of the detection.
    onset : int
        Last sample with the old parameters.
    parameters : tuple of str
        Parameters that changed; empty for a change that no hypothesis explains.
    ratio : tuple of float
        New value over old value, for each parameter.
    reason : str
        Why there are no parameters; empty where there are.
    interval : tuple of (float, float)
        95 % interval of the ratio, for each parameter; empty if none is claimed.
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
    Run an estimator over N samples, by its own ``run`` if it has one, otherwise step by step.

    Parameters
    ----------
    estimator : Estimator
        Afterwards in the state after the last sample.
    u, y : (N,) array_like
    valid : (N,) array_like of bool, optional
        False where y is missing.

    Returns
    -------
    (N, p) array
        θ[0], θ[1], …

    Raises
    ------
    EstimatorError
        If the signals cannot be used, or the estimator returns no numbers.
    """
    u, y, present = check_signals(u, y, valid)
    run = getattr(estimator, "run", None)
    if run is not None:
        missing = () if present.all() else (present,)  # a user's run may not support gaps
        return numbers_of(run(u, y, *missing), run)
    names = tuple(estimator.names)
    estimates, k = np.empty((len(u), len(names))), 0
    try:
        for k in range(len(u)):
            theta = estimator.step(float(u[k]), float(y[k]) if present[k] else None)
            estimates[k] = theta_of(theta, names, estimator)
    except BaseException as error:
        error.at_sample = k  # type: ignore[attr-defined]  # for the message of the runner
        raise
    return estimates


def theta_of(
    returned: ArrayLike, names: Sequence[str], estimator: Estimator
) -> NDArray[np.float64]:
    """
    Return the result of a step as floats, one for each name.

    Parameters
    ----------
    returned : (p,) array_like
        A single number as well if p is 1.
    names : sequence of str
    estimator : Estimator
        The estimator that returned it, for the message.

    Returns
    -------
    (p,) array

    Raises
    ------
    StepError
        If it is not numbers, or has another number of values.
    """
    theta = numbers_of(returned, estimator.step)
    if returned is not None and theta.size == len(names):
        return theta.reshape(-1)
    several = "nothing" if returned is None else f"{theta.size} number{'s'[: theta.size != 1]}"
    told = f"step returned {several}, names has {len(names)}: {', '.join(names)}"
    raise StepError(told + _place(estimator.step))


def numbers_of(returned: ArrayLike, call: Callable[..., object]) -> NDArray[np.float64]:
    """
    Return the result of a call as floats, NaN where an array is masked.

    Parameters
    ----------
    returned : array_like
    call : callable
        The function that returned it, for the message.

    Raises
    ------
    StepError
        If it is not numbers.
    """
    try:
        return np.asarray(np.ma.filled(returned, np.nan), float)
    except (TypeError, ValueError) as error:
        name = getattr(call, "__name__", "it")
        raise StepError(f"{name} returned no numbers: {error}{_place(call)}") from None


def _place(call: Callable[..., object]) -> str:
    code = getattr(getattr(call, "__func__", call), "__code__", None)
    return f" ({code.co_filename}:{code.co_firstlineno})" if code else ""
