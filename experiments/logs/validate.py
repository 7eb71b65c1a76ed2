"""An identified axis on a log that it was not identified from: simulation and prediction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.attempt import Attempt, log_of
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.judging import Fit, fit_of
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

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
    attempt = Attempt(log, axis.model, names, delay=axis.delay, highpass=axis.highpass)
    problem = attempt.problem()
    z = problem.start(axis.model.parametrize(names).theta, axis.delay, attempt.first())
    z[-2:] = axis.offset, axis.delay
    found = attempt.at(z, fixed=len(names))
    if not np.isfinite(found.residual).all():
        raise LogError("the axis cannot be simulated over this log: is it the same axis?")
    colour = replace(found.colour, inverse=np.array(axis.whitening))
    white = colour.white(colour.bridged(found.residual, log.ok))
    good = colour.settled(log.ok)
    fit = fit_of(log.y, found.residual, attempt.counted, colour)
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
