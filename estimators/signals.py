"""The signals that an estimator can read, the models of these signals, and checks of samples."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.models.axes import with_angle
from flexaxis.estimators.models.model import Model

Array = NDArray[np.float64]


def increment(model: Model, period: float) -> Model:
    """
    Return the model whose output is the mean speed (φ[k]−φ[k−1])/T over the last sample.

    An additional state, which is reset to zero at the start of every sample, integrates the speed.
    The increment of the angle is therefore modelled exactly. Treating the increment as a sampled
    speed would bias the estimates.

    Parameters
    ----------
    model : Model
        Model whose output is the speed.
    period : float
        Sampling period T [s].

    Returns
    -------
    Model
        The model with the additional state ``angle_increment`` and the new output.
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
    Return the model whose output is the motor angle relative to its start [rad].

    The output is an additional state, ``angle_read``, the integral of the speed. A filter that uses
    this model has to correct its state, because an integrator does not forget errors. The rounding
    error of an encoder is nearly white on the angle, but not on the increments.

    Parameters
    ----------
    model : Model
        Model whose output is the speed.
    """
    C = (*["0"] * len(model.states), "1")
    return replace(with_angle(model, "angle_read"), name=f"{model.name}, angle", C=C)


@dataclass(frozen=True)
class Signal:
    """
    A measured signal y that an estimator may read.

    Attributes
    ----------
    name : str
        Name of the signal.
    unit : str
        Unit of the signal.
    predicted : callable
        Function ``predicted(model, period)`` that converts a model with speed output to the model
        that predicts y. For an angle, this model predicts increments, because a predictor does not
        correct its state.
    mean_speed : callable
        Function ``mean_speed(period)`` that returns the weights of y[k] and y[k−1] in the mean
        speed between the two samples.
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
"""The signals by name; an estimator's ``output`` is one of these names."""


def find_signal(output: str) -> Signal:
    """Return the signal with this name; raise EstimatorError if the name is unknown."""
    if output not in SIGNALS:
        raise EstimatorError(f"unknown output {output!r}: {did_you_mean(str(output), SIGNALS)}")
    return SIGNALS[output]


def increments(
    angles: Array, valid: NDArray[np.bool_], before: float, period: float
) -> tuple[Array, NDArray[np.bool_], float]:
    """
    Return the increments (φ[k]−φ[k−1])/T of angles φ (N,), their validity (N,), and the last φ.

    Parameters
    ----------
    angles : (N,) array
        Angles φ [rad].
    valid : (N,) bool array
        Whether each angle is valid. A missing angle makes two increments invalid.
    before : float
        Angle at the sample before the first one [rad], or NaN.
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
    Return u, y and valid as contiguous, writable arrays of equal length, for compiled code.

    Parameters
    ----------
    u, y : (N,) array_like
        Torque and measured output.
    valid : (N,) array_like of bool, optional
        False where y is missing; True everywhere by default.

    Returns
    -------
    u, y : (N,) arrays
        Torque and measured output.
    valid : (N,) bool array
        Whether each y is valid.

    Raises
    ------
    EstimatorError
        If the lengths differ, an array is not one-dimensional, or a value is not finite.
    """
    u, y = np.require(u, float, ["C", "W"]), np.require(y, float, ["C", "W"])
    present = np.ones(y.shape, bool) if valid is None else np.require(valid, bool, ["C", "W"])
    for name, values in (("u", u), ("y", y), ("valid", present)):
        if values.ndim != 1:
            raise EstimatorError(f"{name} has the shape {values.shape}; give one value per sample")
        if len(values) != len(u):
            raise EstimatorError(
                f"u has {len(u)} samples and {name} has {len(values)}; the numbers must be equal"
            )
        finite = np.isfinite(values)
        if not finite.all():
            k = int(np.argmin(finite))
            raise EstimatorError(
                f"{name} is {values[k]} at sample {k}; every value must be finite "
                "(mark a gap with valid[k] = False and any finite value)"
            )
    return u, y, present


def check_sample(u: float, y: float | None) -> None:
    """Raise EstimatorError if u is not finite, or if y is neither finite nor None."""
    for name, value in (("u", u), ("y", 0.0 if y is None else y)):
        if not isfinite(value):
            raise EstimatorError(f"{name} is {value}; it must be finite (y=None marks a gap)")
