"""How well a model explains a log, and an axis on a log that it was not identified from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.colour import Colour
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.signals import increment
from flexaxis.experiments.logs.axis_file import Axis, usable
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identification.log import log_of
from flexaxis.experiments.logs.identification.setup import Setup
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

POOR = (
    10.0  # points of fit: worse than its errors elsewhere leave by more than that is another axis
)
MATCHED = 50.0  # per cent of a fit, where nobody knows how large errors usually are
LAGS = 20


@dataclass(frozen=True)
class Fit:
    """How well a simulation from the torque alone does, above the corner of the axis.

    Attributes
    ----------
    percent : float
        100 (1 − |y − ŷ|/|y − mean y|).
    error, size : float
        Standard deviations of y − ŷ and of y [rad/s].
    """

    percent: float
    error: float
    size: float

    def unlike(self, usual: float | None) -> str:
        """Return in a sentence that this is not the axis whose errors are usually as large.

        A log with less motion has a poorer fit by the same errors.
        """
        expected = MATCHED + POOR if usual is None else 100 * (1 - usual / self.size)
        if self.percent > 0 and (self.percent >= expected - POOR or self.error <= (usual or 0.0)):
            return ""
        told = "" if usual is None else f", and its errors elsewhere would leave {expected:.1f} %"
        return (
            f"a simulation from the torque fits by {self.percent:.1f} % only{told}: either it is "
            "not the axis that was identified, or a motion that its log did not show, or torque or "
            "angle are in another unit or of another sign. Compare units and scales with the first "
            "log, or identify again"
        )


def fit_of(y: Array, residual: Array, ok: Flags, colour: Colour) -> Fit:
    """Return how well a simulation does.

    Parameters
    ----------
    y, residual : ndarray (N,)
        Measured output, and what the simulation leaves of it.
    ok : ndarray (N,) of bool
        What counts.
    colour : Colour
        Of which the high-pass counts.
    """
    high, there = colour.high, ok.copy()
    there[: colour.skip] = False
    size = float(np.std(high(y)[there]))
    error = float(np.std(high(colour.bridged(residual, ok))[there]))
    return Fit(100 * (1 - error / max(size, 1e-300)), error, size)


def correlations(white: Array) -> Array:
    """Return the correlations of a residual (N,) with its past, from 0 to N − 1 samples back."""
    e = white - white.mean()
    past = correlate(e, e, method="fft")[len(e) - 1 :]
    return past / past[0]


def correlation(white: Array) -> float:
    """Return the largest correlation of a residual with its past, 1 to `LAGS` samples back."""
    past = correlations(white)[1 : LAGS + 1]
    return float(past[np.argmax(abs(past))])


def at_limits(names: Sequence[str], theta: Array, bounds: Array, known: Array) -> list[str]:
    """Return in a sentence which estimates stand at a limit, and so are none.

    Parameters
    ----------
    names : sequence of str
    theta, known : ndarray (p,)
        Estimates, and what is known of the axis.
    bounds : ndarray (2, p)
        Lowest and highest values that are allowed.
    """
    stuck = [
        f"{name} at {value / of:.3g} times what is known"
        for name, value, of, low, high in zip(names, theta, known, *bounds, strict=True)
        if value in (low, high)
    ]
    word = "stands at a limit" if len(stuck) == 1 else "stand at limits"
    ask = "is it a log of this axis, in the same units, and does its torque have the same sign?"
    return [f"{', '.join(stuck)} {word}, which is no estimate: {ask}"] if stuck else []


PERIODS = 20  # of the motion, that is shown of a log: its liveliest piece


@dataclass(frozen=True)
class Validation:
    """What an axis says of another log.

    Attributes
    ----------
    time, measured, simulated, predicted : ndarray (N,)
        [s], and the output [rad/s]: as logged, simulated from the torque alone, and predicted over
        one sample from the past of both.
    ok : ndarray (N,) of bool
        Where it counts.
    fit : Fit
        Of the simulation.
    prediction : float
        Fit of the prediction over one sample [%].
    unlike : str
        What it says against the axis; empty if nothing.
    """

    time: Array
    measured: Array
    simulated: Array
    predicted: Array
    ok: NDArray[np.bool_]
    fit: Fit
    prediction: float
    unlike: str

    @property
    def simulation(self) -> float:
        """Fit of the simulation [%]."""
        return self.fit.percent


def validate(record: Record, axis: Axis) -> Validation:
    """Simulate and predict a record, with nothing fitted to it but the state that it begins in.

    Parameters
    ----------
    record : Record
    axis : Axis

    Raises
    ------
    LogError
        If the log has another rate than the one that the axis was identified at.
    """
    axis.check_rate(record.period)
    log, names = log_of(record, axis), tuple(axis.model.parameters[:1])
    setup = Setup(log, axis.model, names, delay=axis.delay, highpass=axis.highpass)
    found = setup.begun(axis.offset, axis.delay)
    if not np.isfinite(found.residual).all():
        raise LogError("the axis cannot be simulated over this log: is it the same axis?")
    colour = replace(found.colour, inverse=np.array(axis.whitening))
    white = colour.white(colour.bridged(found.residual, setup.ok))
    good = colour.settled(setup.ok)
    fit = fit_of(log.y, found.residual, setup.counted, colour)
    return Validation(
        record.time,
        log.y,
        log.y - found.residual,
        log.y - white,
        good,
        fit,
        100 * (1 - float(np.std(white[good])) / fit.size),
        fit.unlike(axis.usual),
    )


def liveliest(time: Array, measured: Array, followed: Array, ok: NDArray[np.bool_]) -> slice:
    """Return the samples of the piece of a log that moves most: about `PERIODS` periods."""
    # a sine moves by its angular frequency times itself
    rate = float(np.std(np.diff(followed[ok])) / max(float(np.std(followed[ok])), 1e-300))
    length = int(np.clip(PERIODS * 2 * np.pi / max(rate, 1e-9), 20, len(time) // 2))
    power = np.convolve(np.where(ok, measured, 0.0) ** 2, np.ones(length), "valid")
    begin = int(np.argmax(power))
    return slice(begin, begin + length)


@dataclass(frozen=True)
class Load:
    """Load angle from motor angle and model, and the hidden encoder it is compared with.

    Attributes
    ----------
    predicted, measured : ndarray (N,)
        [rad].
    fit : float
        100 (1 − |measured − predicted|/|measured − mean|).
    """

    predicted: Array
    measured: Array
    fit: float


def load_side(model: Model) -> Model | None:
    """Return the rest of a model when its motor speed is given: from motor speed to load speed.

    Row and column of the motor are taken out; what it did to the others becomes the input. None
    if there are no states ``speed_motor`` and ``speed_load`` or ``speed_arm``.
    """
    states = list(model.states)
    load = next((name for name in ("speed_load", "speed_arm") if name in states), None)
    if load is None or "speed_motor" not in states:
        return None
    motor = states.index("speed_motor")
    rest = [i for i in range(len(states)) if i != motor]
    return Model(
        name=f"{model.name}, load side",
        states=[states[i] for i in rest],
        A=[[model.A[i][j] for j in rest] for i in rest],
        B=[model.A[i][motor] for i in rest],
        C=["1" if states[i] == load else "0" for i in rest],
        nominal=model.nominal,
    )


def predicted_load(record: Record, axis: Axis, estimates: dict[str, float]) -> Load | None:
    """Predict the load angle from the measured motor angle by the estimated model, if it has one.

    Parameters
    ----------
    record : Record
        With the angle of its load, and increments of its motor.
    axis : Axis
    estimates : dict of str to float
        Of parameters, or their inverses, that stand in for nominal values.
    """
    side = load_side(axis.model)
    if side is None or record.true_angle_a is None or record.increment is None:
        return None
    named = [(name.removeprefix("1/"), name.startswith("1/"), v) for name, v in estimates.items()]
    physical = {name: 1 / value if inverse else value for name, inverse, value in named}
    side = replace(side, nominal=dict(axis.model.nominal) | physical)
    chosen = increment(side, record.period).parametrize(side.parameters[:1])
    # the increment up to t_{k+1} is the mean motor speed over the sample from t_k on
    moved = np.append(record.increment[1:], record.increment[-1])
    speed, _ = predict(chosen, chosen.theta, moved, period=record.period)
    predicted, ok = np.cumsum(speed) * record.period, usable(record)
    error = record.true_angle_a - predicted
    off = float(np.mean(error[ok]))
    fit = 100 * float(1 - np.std(error[ok]) / np.std(record.true_angle_a[ok]))
    return Load(predicted + off, record.true_angle_a, fit)
