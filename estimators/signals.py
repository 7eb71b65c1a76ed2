"""The output signals that an estimator can process, their models, and checks of the samples."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.models.axis_models import with_angle
from flexaxis.estimators.models.model import Model

Array = NDArray[np.float64]


def increment(model: Model, period: float) -> Model:
    """
    Return a model whose output is the mean motor speed (φ[k]−φ[k−1])/T over the last sample.

    An additional state integrates the speed and is reset to zero at the start of every sample. The
    returned model therefore describes the angle increment exactly. If an estimator treated angle
    increments as sampled speeds, the estimates would be biased.

    Parameters
    ----------
    model : Model
        Axis model whose output is the motor speed.
    period : float
        Sampling period T [s].

    Returns
    -------
    Model
        The given model with the additional state ``angle_increment`` and the mean speed as output.
    """
    state = "angle_increment"
    return replace(
        with_angle(model, state),
        name=f"{model.name}, increments",
        C=(*["0"] * len(model.states), repr(1 / float(period))),
        reset=(*model.reset, state),
    )


def counted_angle(model: Model) -> Model:
    """
    Return a model whose output is the motor angle relative to the initial angle [rad].

    The output is the additional state ``angle_read``, which is the integral of the speed. A filter
    that uses this model has to correct the state with the measured angle, because an integrator
    does not forget errors. An encoder's rounding error is nearly white noise in the angle, but not
    in the angle increments.

    Parameters
    ----------
    model : Model
        Axis model whose output is the motor speed.
    """
    C = (*["0"] * len(model.states), "1")
    return replace(with_angle(model, "angle_read"), name=f"{model.name}, angle", C=C)


@dataclass(frozen=True)
class Signal:
    """
    An output signal y that an estimator can process.

    Attributes
    ----------
    name : str
        Name of the output signal.
    unit : str
        Unit of the output signal.
    predicted : callable
        Function ``predicted(model, period)`` that converts a model with speed output to a model
        that predicts y. For an angle, the converted model predicts angle increments, because a
        predictor does not correct its state.
    mean_speed : callable
        Function ``mean_speed(period)`` that returns the weights of y[k] and y[k−1] in the mean
        speed between the samples k−1 and k.
    """

    name: str
    unit: str
    predicted: Callable[[Model, float], Model]
    mean_speed: Callable[[float], tuple[float, float]]


SIGNALS = {
    signal.name: signal
    for signal in (
        Signal(
            "speed",
            "rad/s",
            predicted=lambda model, period: model,
            mean_speed=lambda period: (0.5, 0.5),
        ),
        Signal(
            "increment",
            "rad/s",
            predicted=increment,
            mean_speed=lambda period: (1.0, 0.0),
        ),
        Signal(
            "angle",
            "rad",
            predicted=increment,
            mean_speed=lambda period: (1 / period, -1 / period),
        ),
    )
}
"""The output signals, keyed by name; an estimator's attribute ``output`` is one of these names."""


def find_signal(output: str) -> Signal:
    """Return the output signal with the given name; raise EstimatorError for an unknown name."""
    if output not in SIGNALS:
        raise EstimatorError(f"unknown output {output!r}: {did_you_mean(str(output), SIGNALS)}")
    return SIGNALS[output]


def increments(
    angles: Array, valid: NDArray[np.bool_], before: float, period: float
) -> tuple[Array, NDArray[np.bool_], float]:
    """
    Return angle increments (φ[k]−φ[k−1])/T, a mask of the valid increments, and the last angle.

    The increments and the mask have the shape (N,).

    Parameters
    ----------
    angles : (N,) array
        Angles φ [rad].
    valid : (N,) bool array
        Mask that is True for valid angles. A missing angle makes two angle increments invalid.
    before : float
        Angle one sample before the first element of ``angles`` [rad], or NaN if it is missing.
    period : float
        Sampling period T [s].
    """
    readings = np.append(before, np.where(valid, angles, np.nan))
    rates = np.diff(readings) / period
    return np.nan_to_num(rates), np.isfinite(rates), float(readings[-1])


def check_signals(
    u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """
    Check u, y and valid, and return them as contiguous, writable arrays for compiled code.

    Parameters
    ----------
    u, y : (N,) array_like
        Motor torque and measured output.
    valid : (N,) array_like of bool, optional
        Mask that is False where y is missing; by default, y is valid in all samples.

    Returns
    -------
    u, y : (N,) arrays
        Motor torque and measured output.
    valid : (N,) bool array
        For each sample, whether the output is valid.

    Raises
    ------
    EstimatorError
        If the array lengths differ, an array is not one-dimensional, or a value is not finite.
    """
    u, y = np.require(u, float, ["C", "W"]), np.require(y, float, ["C", "W"])
    present = np.ones(y.shape, bool) if valid is None else np.require(valid, bool, ["C", "W"])
    for name, values in (("u", u), ("y", y), ("valid", present)):
        if values.ndim != 1:
            raise EstimatorError(
                f"the signal {name} has the shape {values.shape}; give one value for each sample"
            )
        if len(values) != len(u):
            raise EstimatorError(
                f"u has {len(u)} samples and {name} has {len(values)}; the lengths must be equal"
            )
        finite = np.isfinite(values)
        if not finite.all():
            k = int(np.argmin(finite))
            raise EstimatorError(
                f"{name} is {values[k]} at sample {k}, but every value must be finite (to mark a "
                "gap, set valid[k] = False and y[k] to any finite value)"
            )
    return u, y, present


def check_sample(u: float, y: float | None) -> None:
    """Raise EstimatorError if u is not finite, or if y is neither finite nor None."""
    for name, value in (("u", u), ("y", 0.0 if y is None else y)):
        if not isfinite(value):
            raise EstimatorError(
                f"{name} is {value}, but every sample must be finite (for a gap, give y=None)"
            )
