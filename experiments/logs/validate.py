"""An identified axis on a log that it was not identified from: simulation and prediction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.colour import Colour, colourless
from flexaxis.estimators.offline.prediction_error import finished
from flexaxis.experiments.logs.attempt import Attempt, log_of
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.fits import Fits, contradictions, fits
from flexaxis.sim.record import Record

Array = NDArray[np.float64]


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
    fits : Fits
        Of both.
    warnings : tuple of str
        What it says against the axis.
    """

    time: Array
    measured: Array
    simulated: Array
    predicted: Array
    ok: NDArray[np.bool_]
    fits: Fits
    warnings: tuple[str, ...] = ()

    @property
    def simulation(self) -> float:
        """Fit of the simulation."""
        return self.fits.simulation

    @property
    def prediction(self) -> float:
        """Fit of the prediction over one sample."""
        return self.fits.prediction


def validate(record: Record, axis: Axis, own: Fits | None = None) -> Validation:
    """Simulate and predict a record, with nothing fitted to it but the state that it begins in.

    Parameters
    ----------
    record : Record
    axis : Axis
    own : Fits, optional
        Those of the log that the axis was identified from, to compare with.

    Raises
    ------
    LogError
        If the log has another rate than the one that the axis was identified at.
    """
    axis.check_rate(record.period)
    log = log_of(record, axis)
    names = tuple(axis.model.parameters[:1])
    attempt = Attempt(log, axis.model, names, delay=axis.delay, highpass=axis.highpass)
    problem = attempt.problem()
    held = np.ones(problem.course.q, bool)
    held[len(names) : -2] = False  # the state that it begins in
    problem = replace(problem, held=held)
    plain = colourless(axis.highpass, log.period)
    colour: Colour = replace(plain, inverse=np.array(axis.whitening))
    z = np.zeros(problem.course.q)
    z[: len(names)] = axis.model.parametrize(names).theta
    z[-2:] = axis.offset, axis.delay
    found = finished(problem, problem.descend(problem.at(z, colour), colour, 6)[0], colour)
    if not np.isfinite(found.residual).all():
        raise LogError("the axis cannot be simulated over this log: is it the same axis?")
    y, theirs = log.y, fits(log.y, found)
    return Validation(
        record.time,
        y,
        y - found.residual,
        y - found.white,
        found.good,
        theirs,
        () if own is None else contradictions(own, theirs),
    )
