"""The parameters of a known axis from one more log of it: a few Gauss-Newton steps, with intervals.

`identify` finds an axis from nothing, and solves its laws to their full accuracy; this starts from
what is known and stays near, with laws as a search takes them, so that it is done for a thousand
logs. What that leaves out is alike in all logs of a test motion, and no change.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.colour import HIGHEST_ORDER, Colour, colourless, noise_model
from flexaxis.estimators.offline.sizes import state_sizes
from flexaxis.estimators.offline.trajectory import Course, course
from flexaxis.experiments.logs.attempt import log_of
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.likeness import MATCHED, at_limits, no_fit
from flexaxis.experiments.logs.pieces import PIECES
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

STEPS = 12
FARTHEST = 0.3  # relative change of a parameter in one step
RANGE = (0.05, 20.0)  # times the known value, beyond which a log is of another axis
RESTING = 0.05  # of the rms speed, below which the axis rests at first
SHIFTS = (-3, -2, -1, 0, 1, 2, 3)  # samples of delay that are tried where nothing fits
SEEN = 0.1  # relative standard deviation up to which a log is said to see a parameter


@dataclass(frozen=True)
class Refit:
    """Parameters from one log.

    Attributes
    ----------
    names : tuple of str
    theta, deviations : ndarray (p,)
        The deviation is the larger of that for the modelled noise and that of the blocks.
    offset, offset_deviation : float
        Constant torque that acts besides the logged one, in its unit.
    fit : float
        100 (1 − |y − ŷ|/|y − mean y|) of a simulation from the torque alone, above the high-pass
        of the axis if it has one.
    late, late_deviation : float
        By which the torque acts later than the axis has it [s]: to first order, as nothing else is
        changed for it.
    left : float
        Greatest step that a parameter would still go, in its deviations.
    colour : float
        Share of the residual's variance that its own past predicts: 0 if it is white.
    """

    names: tuple[str, ...]
    theta: Array
    deviations: Array
    offset: float
    offset_deviation: float
    fit: float
    late: float
    late_deviation: float
    left: float
    colour: float


@dataclass(frozen=True)
class _Problem:
    """A log and the model of its axis; the unknowns are θ, where it begins, and a torque."""

    course: Course
    start: Array
    size: Array  # of each unknown beforehand; infinite for those that the log has to tell
    y: Array
    ok: NDArray[np.bool_]
    delay: float
    plain: Colour  # the high-pass of the axis, if it has one

    def error(self, z: Array) -> tuple[Array, Array]:
        """Return y − ŷ (N,), and derivatives (N, q + 1) of ŷ by θ relative to itself … delay."""
        simulated, slopes = self.course.along(np.append(z, self.delay), coarse=True)
        if not (np.isfinite(simulated).all() and np.isfinite(slopes).all()):
            raise LogError("a simulation of this log runs away with the values of the axis")
        psi = slopes.T.copy()
        psi[:, : self.course.p] *= z[: self.course.p]
        return self.y - simulated, psi


def refit(record: Record, axis: Axis, names: Sequence[str]) -> Refit:
    """Estimate parameters of a known axis from one log, with a constant torque and how it begins.

    Output error, the residual modelled as an autoregression and whitened by it, as
    `flexaxis.experiments.logs.identify` does; the delay is that of the axis.

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
    problem = _problem(record, axis, names)
    try:
        return _solution(problem)
    except LogError as error:
        raise LogError(f"{error}{_other_delay(problem)}") from None


def _solution(problem: _Problem) -> Refit:
    p, z = problem.course.p, problem.start.copy()
    bounds = np.sort(np.outer(RANGE, z[:p]), axis=0)
    for _ in range(STEPS):
        error, psi = problem.error(z)
        step, covariance = _solved(problem, z, error, psi[:, :-1], _colour(problem, error))
        z[:p] = np.clip(z[:p] * (1 + np.clip(step[:p], -FARTHEST, FARTHEST)), *bounds)
        z[p:] += step[p:]
        if np.all(abs(step) <= 0.1 * np.sqrt(np.diag(covariance))):  # the noise hangs on all
            break
    return _found(problem, z, bounds)


def _other_delay(problem: _Problem) -> str:
    """Return in words whether the known axis fits a log if its torque acts at another time."""
    fits = {}
    for samples in SHIFTS:
        delay = problem.delay + samples * problem.course.period
        if delay < 0 and not problem.course.smooth:
            continue
        with suppress(LogError):
            error = replace(problem, delay=delay).error(problem.start)[0]
            error, y = (problem.plain.high(s)[problem.ok] for s in (error, problem.y))
            fits[samples] = 100 * float(1 - np.std(error) / np.std(y))
    best = max(fits, key=lambda samples: fits[samples], default=0)
    if not best or fits[best] < MATCHED:
        return ""
    word = "later" if best > 0 else "earlier"
    shift = f"{abs(best)} sample{'s' * (abs(best) > 1)}"
    return f" With its torque {shift} {word}, the known axis fits by {fits[best]:.3g} %"


def _found(problem: _Problem, z: Array, bounds: Array) -> Refit:
    """Return what there is to know where the steps came to."""
    p, names = problem.course.p, problem.course.model.names
    error, psi = problem.error(z)
    colour = _colour(problem, error)
    step, covariance = _solved(problem, z, error, psi[:, :-1], colour)
    claimed = np.sqrt(np.diag(covariance))
    blocks = _block_deviations(problem, z, error, psi[:, :-1], colour)
    with_delay, its_covariance = _solved(problem, z, error, psi, colour)
    e, y = (colour.high(signal)[problem.ok] for signal in (error, problem.y))
    fit = 100 * float(1 - np.std(e) / np.std(y))
    unlike = [*at_limits(names, z[:p], bounds, problem.start[:p]), *no_fit(fit)]
    if unlike:
        raise LogError(unlike[0])
    return Refit(
        names,
        z[:p],
        np.maximum(claimed, blocks)[:p] * abs(z[:p]),
        float(z[-1]),
        float(claimed[-1]),
        fit,
        late=float(with_delay[-1]),
        late_deviation=float(np.sqrt(its_covariance[-1, -1])),
        left=float(np.max(abs(step[:p]) / claimed[:p])),
        colour=_predictable(problem, error, colour),
    )


def _predictable(problem: _Problem, error: Array, colour: Colour) -> float:
    """Return the share of the variance of a residual that its own past predicts."""
    ok = colour.settled(problem.ok)
    left = np.var(colour.white(error)[ok]) / np.var(problem.plain.high(error)[ok])
    return float(np.clip(1 - left, 0.0, 1.0))


def seen(record: Record, axis: Axis, names: Sequence[str]) -> tuple[str, ...]:
    """Return which of some parameters a log tells to `SEEN`, all together.

    The one that is told least is left out, until the others are told well enough.
    """
    left = list(names)
    while left:
        problem = _problem(record, axis, left)
        error, psi = problem.error(problem.start)
        colour = _colour(problem, error)
        covariance = _solved(problem, problem.start, error, psi[:, :-1], colour)[1]
        deviations = np.sqrt(np.diag(covariance))[: len(left)]
        worst = int(np.argmax(deviations))
        if deviations[worst] <= SEEN:
            return tuple(left)
        del left[worst]
    raise LogError("this log tells no parameter to 10 %: excite the axis more, or name --free NAME")


def _problem(record: Record, axis: Axis, names: Sequence[str]) -> _Problem:
    log = log_of(record, axis)
    along = course(
        axis.model,
        names,
        log.u,
        period=log.period,
        output=log.output,
        smooth=log.smooth,
        resting=bool(np.max(abs(log.y[:5])) < RESTING * np.std(log.y)),
    )
    ok = log.ok.copy()
    ok[0] = False  # an increment has no past there, and a state no consequence yet
    plain = colourless(axis.highpass, log.period)
    ok[: plain.skip] = False
    start = np.concatenate([along.model.theta, np.zeros(len(along.free))])
    size = np.full(len(start), np.inf)
    moving = len(along.free) - 1
    if moving:
        # a state that is forgotten before the first sample that counts must not run away
        states = state_sizes(axis.model, log.u, log.period)
        own = np.full(moving - len(states), np.sqrt(np.mean(log.u**2)))
        size[along.p : -1] = np.maximum([*states, *own], 1e-9 * max([*states, *own]))
    if axis.highpass is not None:
        size[-1] = np.sqrt(np.mean(log.u**2))  # nothing of an offset passes
    return _Problem(along, start, size, log.y, ok, axis.delay, plain)


def _colour(problem: _Problem, error: Array) -> Colour:
    high = problem.plain.high(error)
    return replace(problem.plain, inverse=noise_model(high[problem.ok], HIGHEST_ORDER))


def _system(
    problem: _Problem, z: Array, error: Array, psi: Array, colour: Colour
) -> tuple[Array, Array, float]:
    """Return the whitened error and gradient, with a row for each size known beforehand, and σ."""
    ok = colour.settled(problem.ok)
    if ok.sum() <= 10 * psi.shape[1]:
        raise LogError(f"{ok.sum()} usable samples cannot tell {psi.shape[1]} unknowns")
    e, gradient = colour.white(error)[ok], colour.white(psi.T).T[ok]
    step = np.linalg.lstsq(gradient, e, rcond=1e-12)[0]
    sigma = float(np.std(e - gradient @ step))
    known = np.flatnonzero(np.isfinite(problem.size))
    rows = np.zeros((len(known), psi.shape[1]))
    rows[np.arange(len(known)), known] = sigma / problem.size[known]
    return np.r_[e, -rows[:, : len(z)] @ z], np.vstack([gradient, rows]), sigma


def _solved(
    problem: _Problem, z: Array, error: Array, psi: Array, colour: Colour
) -> tuple[Array, Array]:
    """Return the Gauss-Newton step of all, and its covariance."""
    e, gradient, sigma = _system(problem, z, error, psi, colour)
    norm = np.linalg.norm(gradient, axis=0)
    inverse = np.linalg.pinv(gradient / norm, rcond=1e-12)
    return inverse @ e / norm, sigma**2 * inverse @ inverse.T / np.outer(norm, norm)


def _block_deviations(
    problem: _Problem, z: Array, error: Array, psi: Array, colour: Colour
) -> Array:
    """Return the standard deviations by leaving out a tenth of the log at a time: the jackknife."""
    e, gradient, _ = _system(problem, z, error, psi, colour)
    norm = np.linalg.norm(gradient, axis=0)
    known = int(np.isfinite(problem.size).sum())
    scaled, samples = gradient / norm, len(e) - known
    square, product = scaled.T @ scaled, scaled.T @ e
    steps = np.empty((PIECES, len(z)))
    for i, block in enumerate(np.array_split(np.arange(samples), PIECES)):
        mine, its = scaled[block], e[block]
        steps[i] = np.linalg.pinv(square - mine.T @ mine, hermitian=True) @ (product - mine.T @ its)
    spread = steps - steps.mean(axis=0)
    return np.sqrt((PIECES - 1) / PIECES * (spread**2).sum(axis=0)) / norm
