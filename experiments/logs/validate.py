"""How well a model explains a log, and an axis a log that it was not identified from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate

from flexaxis.estimators.offline.colour import Colour
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.setup import Setup
from flexaxis.experiments.logs.signals import log_of
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

POOR = 10.0  # points of fit, by which another axis is worse than errors elsewhere leave
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
            f"a simulation from the torque fits by {self.percent:.1f} % only{told}: it is another "
            "axis, another motion, or torque or angle are in another unit or of another sign; "
            "compare units and scales with the first log, or identify again"
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


def correlation(white: Array) -> float:
    """Return the largest correlation of a residual (N,) with its past, 1 to `LAGS` samples back."""
    e = white - white.mean()
    past = correlate(e, e, method="fft")[len(e) - 1 :][: LAGS + 1]
    past = past[1:] / past[0]
    return float(past[np.argmax(abs(past))])


@dataclass(frozen=True)
class Validation:
    """What an axis says of another log.

    Attributes
    ----------
    time, measured, simulated : ndarray (N,)
        [s], and the output [rad/s]: as logged, and simulated from the torque alone.
    fit : Fit
    unlike : str
        What speaks against the axis; empty if nothing does.
    """

    time: Array
    measured: Array
    simulated: Array
    fit: Fit
    unlike: str


def validate(record: Record, axis: Axis) -> Validation:
    """Simulate a record, with nothing fitted to it but the state that it begins in.

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
    fitted = setup.begun(axis.offset, axis.delay)
    if not np.isfinite(fitted.residual).all():
        raise LogError("the axis cannot be simulated over this log: is it the same axis?")
    fit = fit_of(log.y, fitted.residual, setup.counted, fitted.colour)
    return Validation(record.time, log.y, log.y - fitted.residual, fit, fit.unlike(axis.usual))
