"""An identified axis on a log that it was not identified from: simulation and prediction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexaxis.estimators.offline.colour import Colour, colourless
from flexaxis.estimators.offline.prediction_error import finished
from flexaxis.experiments.logs.attempt import Attempt, log_of
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.fits import Fits, contradictions, fits
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

PERIODS = 20  # of the motion, that is shown of a log: its liveliest piece
BLUE, ORANGE = "#0072B2", "#D55E00"


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


def liveliest(found: Validation) -> slice:
    """Return the samples of the piece of the log that moves most: about `PERIODS` periods."""
    ok = found.ok
    # a sine moves by its angular frequency times itself
    rate = float(np.std(np.diff(found.predicted[ok])) / np.std(found.predicted[ok]))
    length = int(np.clip(PERIODS * 2 * np.pi / rate, 20, len(found.time) // 2))
    power = np.convolve(np.where(ok, found.measured, 0.0) ** 2, np.ones(length), "valid")
    begin = int(np.argmax(power))
    return slice(begin, begin + length)


def validation_figure(found: Validation) -> Figure:
    """Draw `liveliest` with simulation and prediction over it, and errors, for a notebook.

    A page has a chart instead, `log_charts.validation_chart`.
    """
    time, piece = found.time, liveliest(found)
    fig = Figure(figsize=(8.0, 5.0), layout="constrained")
    upper, lower = fig.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    upper.plot(time[piece], found.measured[piece], "k--", lw=1.0, label="log", zorder=3)
    upper.plot(
        time[piece],
        found.simulated[piece],
        color=ORANGE,
        lw=1.3,
        label=f"simulation from the torque alone, fit {found.simulation:.1f} %",
    )
    upper.plot(
        time[piece],
        found.predicted[piece],
        color=BLUE,
        lw=0.8,
        label=f"prediction over one sample, fit {found.prediction:.1f} %",
    )
    for values, shade in ((found.simulated, ORANGE), (found.predicted, BLUE)):
        lower.plot(time[piece], (found.measured - values)[piece], color=shade, lw=0.8)
    upper.set_ylabel("speed [rad/s]")
    lower.set(xlabel="time [s]", ylabel="error [rad/s]")
    for ax in (upper, lower):
        ax.grid(alpha=0.25)
    upper.legend(frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0, 1), ncols=3)
    return fig
