"""
What an estimator is, and what it may tell of a change.

A structural protocol, so that a user's class imports nothing of ours.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.signals import check_signals


class StepError(EstimatorError):
    """What `step` returned is not one number for each name."""


@runtime_checkable
class Estimator(Protocol):
    """
    Anything with names, an output and a step.

    Optional: ``run(u, y, valid=None) -> (N, p)``, the same numbers faster; ``covariance`` (p, p);
    ``innovations`` (N, 2), of each sample of the last ``run`` y − ŷ before y was used, and the
    variance claimed of it, NaN where there was no y; ``alarm`` (bool); ``findings``, a sequence of
    objects with ``alarm`` (sample) and ``parameters`` (names of what has changed); ``reset()``.

    Attributes
    ----------
    names : sequence of str
        What θ means, in this order.
    output : str
        What it reads, of `flexaxis.estimators.signals.SIGNALS`: such as ``"speed"``.
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
    A change that was found.

    Attributes
    ----------
    alarm : int
        Sample at which it was found.
    onset : int
        Sample after which the parameters were different.
    parameters : tuple of str
        What changed; empty for an unmodelled change, which no hypothesis explains.
    ratio : tuple of float
        New value over the value before, for each.
    reason : str
        Why there are no parameters, in words; empty where there are.
    interval : tuple of (float, float)
        Between which the ratio lies with a probability of 95 %, for each; empty where none is
        claimed.
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
    Run an estimator over N samples, by its own ``run`` if it has one, else step by step.

    Parameters
    ----------
    estimator : Estimator
        Left in the state after the last sample.
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
        If the signals cannot be used, or what comes back is no numbers.
    """
    u, y, present = check_signals(u, y, valid)
    run = getattr(estimator, "run", None)
    if run is not None:
        missing = () if present.all() else (present,)  # a user's run may know no gaps
        return numbers_of(run(u, y, *missing), run)
    names = tuple(estimator.names)
    estimates, k = np.empty((len(u), len(names))), 0
    try:
        for k in range(len(u)):
            theta = estimator.step(float(u[k]), float(y[k]) if present[k] else None)
            estimates[k] = theta_of(theta, names, estimator)
    except BaseException as error:
        error.at_sample = k  # type: ignore[attr-defined]  # for whoever says where it was
        raise
    return estimates


def theta_of(
    returned: ArrayLike, names: Sequence[str], estimator: Estimator
) -> NDArray[np.float64]:
    """
    Return what a step returned as numbers, one for each name.

    Parameters
    ----------
    returned : (p,) array_like
        A single number as well, where p is 1.
    names : sequence of str
    estimator : Estimator
        Whose step it was, for the message.

    Returns
    -------
    (p,) array

    Raises
    ------
    StepError
        If it has another number of values; one would otherwise stand for all of them. Or if they
        are texts or truths, which only look like numbers.
    """
    theta = numbers_of(returned, estimator.step)
    if returned is not None and theta.size == len(names):
        return theta.reshape(-1)
    several = "nothing" if returned is None else f"{theta.size} number{'s'[: theta.size != 1]}"
    told = f"step returned {several}, names has {len(names)}: {', '.join(names)}"
    raise StepError(told + _place(estimator.step))


def numbers_of(returned: ArrayLike, call: Callable[..., object]) -> NDArray[np.float64]:
    """
    Return what a call returned as floats, NaN where an array is masked.

    Parameters
    ----------
    returned : array_like
    call : callable
        What returned it, for the message.

    Returns
    -------
    ndarray of float

    Raises
    ------
    StepError
        If it is something else, although NumPy may make floats of it.
    """
    array = np.asarray(returned)
    kind = array.dtype.kind
    if kind == "O":  # such as decimals, but not whatever a float can be read from
        odd = next((x for x in array.flat if isinstance(x, str | bytes | bool)), 0.0)
        kind = np.asarray(odd).dtype.kind
    if kind in _NO_NUMBERS:
        name = getattr(call, "__name__", "it")
        raise StepError(
            f"{name} returned {_NO_NUMBERS[kind]}, and numbers are needed{_place(call)}"
        )
    values = np.asarray(array, float)
    if isinstance(returned, np.ma.MaskedArray):
        return np.where(np.ma.getmaskarray(returned), np.nan, values)
    return values


_NO_NUMBERS = {
    "b": "truths", "U": "texts", "S": "bytes", "c": "complex numbers", "V": "records", "M": "dates",
    "m": "durations",
}  # fmt: skip
"""Kinds of arrays that NumPy would turn into floats, or whose imaginary parts it would drop."""


def _place(call: Callable[..., object]) -> str:
    code = getattr(getattr(call, "__func__", call), "__code__", None)
    return f" ({code.co_filename}:{code.co_firstlineno})" if code else ""
