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
from flexaxis.experiments.logs.identification.setup import Setup, log_of
from flexaxis.experiments.logs.identification.validate import Fit, at_limits, fit_of
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
    offset, offset_deviation : float
        Constant torque that acts besides the logged one, in its unit.
    fit : Fit
        Of a simulation from the torque alone, above the high-pass of the axis if it has one.
    late, late_deviation : float
        By which the torque acts later than the axis has it [s]: to first order, as nothing else is
        changed for it.
    left : float
        How far it is to the bottom, in standard deviations of all unknowns together.
    colour : float
        Share of the residual's variance that its own past predicts: 0 if it is white.
    """

    names: tuple[str, ...]
    theta: Array
    deviations: Array
    offset: float
    offset_deviation: float
    fit: Fit
    late: float
    late_deviation: float
    left: float
    colour: float


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
    setup = _setup(record, axis, names)
    known = axis.model.parametrize(names).theta
    fitted = setup.solve(known, axis.delay, rounds=STEPS, fine=False)
    if not np.isfinite(fitted.square):
        raise LogError("a simulation of this log runs away with the values of the axis")
    # a filter that makes what is left white may hide the state that a log begins in
    fit = _fit(setup, fitted if setup.log.resting else setup.at(fitted.z, fixed=len(names)))
    theta = fitted.z[: len(names)]
    bounds = np.sort(np.outer(RANGE, known), axis=0)
    unlike = at_limits(names, theta, bounds, known)
    if unlike or fit.percent <= 0:
        raise LogError(unlike[0] if unlike else fit.unlike(None))
    late, late_deviation, left = _late(setup, fitted)
    high = fitted.colour.high(fitted.residual)[fitted.good]
    return Refit(
        tuple(names),
        theta,
        np.maximum(fitted.deviations, over_pieces(fitted))[: len(names)],
        float(fitted.z[-2]),
        float(fitted.deviations[-2]),
        fit,
        late,
        late_deviation,
        left,
        float(np.clip(1 - fitted.square / np.var(high), 0.0, 1.0)),
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
    return Setup(
        log_of(record, axis),
        axis.model,
        tuple(names),
        delay=axis.delay,
        highpass=axis.highpass,
        lower=lower,
        upper=upper,
    )


def _fit(setup: Setup, fitted: Fitted) -> Fit:
    log = setup.log
    return fit_of(log.y, fitted.residual, setup.counted, fitted.colour)


def _late(setup: Setup, fitted: Fitted) -> tuple[float, float, float]:
    """Return by how much the torque acts later, its deviation, and how far it is to the bottom."""
    known = setup.problem()
    free = replace(known, held=np.append(known.held[:-1], False))
    # where the search ended is the bottom of laws as it solves them
    at = free.at(fitted.z, fitted.colour, coarse=known.course.coarsens)
    moves = ~free.held
    H = at.H[np.ix_(moves, moves)]
    step = damped_step(H, at.g[moves], 0.0)
    size = np.sqrt(np.maximum(np.diag(H), np.finfo(float).tiny))
    inverse = np.linalg.pinv(H / np.outer(size, size), hermitian=True)[-1, -1] / size[-1] ** 2
    return float(step[-1]), float(np.sqrt(at.square / at.samples * inverse)), known.left(at)
