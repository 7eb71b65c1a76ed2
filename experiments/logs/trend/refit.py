"""The parameters of a known axis from one more log of it: a few steps from there, with intervals.

`identify` finds an axis from nothing; this starts from what is known and stays near, with laws as a
search takes them, so that it is done for a thousand logs. What that leaves out is alike in all logs
of a test motion, and no change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.descent import damped_step
from flexaxis.estimators.offline.prediction_error import Fitted
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identification.candidates import over_pieces
from flexaxis.experiments.logs.identification.log import log_of
from flexaxis.experiments.logs.identification.setup import Setup
from flexaxis.experiments.logs.identification.validate import at_limits, fit_of
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

STEPS = 6  # rounds of parameters and noise
RANGE = (0.05, 20.0)  # times the known value, beyond which a log is of another axis
SEEN = 0.1  # relative standard deviation up to which a log is said to see a parameter


@dataclass(frozen=True)
class Refit:
    """Parameters from one log.

    Attributes
    ----------
    names : tuple of str
    theta, deviations : ndarray (p,)
        The deviation is the larger of that for the modelled noise and that over pieces.
    offset : (float, float)
        Constant torque that acts besides the logged one, in its unit, and its deviation.
    fit, error : float
        Of a simulation from the torque alone, above the high-pass of the axis if it has one [%],
        and the standard deviation that it leaves.
    late : (float, float)
        By which the torque acts later than the axis has it [s], and its deviation: to first order,
        as nothing else is changed for it.
    left : float
        How far it is to the bottom, in standard deviations of all unknowns together.
    """

    names: tuple[str, ...]
    theta: Array
    deviations: Array
    offset: tuple[float, float]
    fit: float
    error: float
    late: tuple[float, float]
    left: float


def refit(record: Record, axis: Axis, names: Sequence[str]) -> Refit:
    """Estimate parameters of a known axis from one log, with a constant torque and how it begins.

    The delay is that of the axis.

    Parameters
    ----------
    record : Record
    axis : Axis
        With its known values.
    names : sequence of str
        Parameters to estimate; the others stay.

    Raises
    ------
    LogError
        If the log does not fit the axis at all.
    """
    setup, p = _setup(record, axis, names), len(names)
    known = axis.model.parametrize(names).theta
    fitted = setup.solve(known, axis.delay, rounds=STEPS, fine=False)
    if not np.isfinite(fitted.square):
        raise LogError("a simulation of this log runs away with the values of the axis")
    # a filter that makes what is left white may hide the state that a stretch begins in
    alone = setup.log.resting and len(setup.begins) == 1
    shown = fitted if alone else setup.at(fitted.z, fixed=p)
    fit = fit_of(setup.log.y, shown.residual, setup.counted, shown.colour)
    bounds = np.sort(np.outer(RANGE, known), axis=0)
    unlike = at_limits(names, fitted.z[:p], bounds, known)
    if unlike or fit.percent <= 0:
        raise LogError(unlike[0] if unlike else fit.unlike(None))
    late, left = _late(setup, fitted)
    return Refit(
        tuple(names),
        fitted.z[:p],
        np.maximum(fitted.deviations, over_pieces(fitted))[:p],
        (float(fitted.z[-2]), float(fitted.deviations[-2])),
        fit.percent,
        fit.error,
        late,
        left,
    )


def seen(record: Record, axis: Axis, names: Sequence[str]) -> tuple[str, ...]:
    """Return which of some parameters a log tells to `SEEN`, all together.

    The one that is told least is left out, until the others are told well enough.
    """
    left = list(names)
    while left:
        setup = _setup(record, axis, left)
        theta = axis.model.parametrize(left).theta
        z = setup.problem().start(theta, axis.delay, setup.first())
        deviations = setup.at(z, fixed=len(left)).deviations[: len(left)] / abs(theta)
        worst = int(np.argmax(deviations))
        if deviations[worst] <= SEEN:
            return tuple(left)
        del left[worst]
    raise LogError("this log tells no parameter to 10 %: excite the axis more, or name --free NAME")


def _setup(record: Record, axis: Axis, names: Sequence[str]) -> Setup:
    known = axis.model.parametrize(names).theta
    lower, upper = (
        dict(zip(names, side.tolist(), strict=True))
        for side in np.sort(np.outer(RANGE, known), axis=0)
    )
    setup = Setup(log_of(record, axis), axis.model, tuple(names), lower=lower, upper=upper)
    return replace(setup, delay=axis.delay, highpass=axis.highpass)


def _late(setup: Setup, fitted: Fitted) -> tuple[tuple[float, float], float]:
    """Return by how much the torque acts later, with its deviation; how far it is to the bottom."""
    known = setup.problem()
    free = replace(known, held=np.append(known.held[:-1], False))
    # where the search ended is the bottom of laws as it solves them
    at = free.at(fitted.z, fitted.colour, coarse=known.course.coarsens)
    H, g = at.H[~free.held][:, ~free.held], at.g[~free.held]
    last = np.eye(len(g))[-1]
    late, variance = (float(damped_step(H, side, 0.0)[-1]) for side in (g, last))
    return (late, float(np.sqrt(at.square / at.samples * variance))), known.left(at)
