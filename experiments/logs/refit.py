"""The parameters of a known axis from one more log of it: a few Gauss-Newton steps, with intervals.

`identify` finds an axis from nothing; this starts from what is known of it and stays near, so that
it takes a second and can be done for a thousand logs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexaxis.estimators.models.model import increment
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.offline.delay import delayed
from flexaxis.estimators.offline.predictor import predict
from flexaxis.experiments.logs.axis_file import Axis, is_smooth, output_of, usable
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identify import HIGHEST_ORDER, noise_model, settled
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

STEPS = 12
FARTHEST = 0.3  # relative change of a parameter in one step
RANGE = (0.05, 20.0)  # times the known value, beyond which a log is of another axis
BLOCKS = 10  # of a log, whose spread is an interval that assumes no model of the noise
NUDGE = 1e-4  # of the rms torque, to take the effect of a constant torque by differences
SEEN = 0.1  # relative standard deviation up to which a log is said to see a parameter


@dataclass(frozen=True)
class Refit:
    """Parameters from one log.

    Attributes
    ----------
    names : tuple of str
    theta, deviations : ndarray (p,)
        The deviation is the larger of that for the modelled noise and that of the blocks.
    offset : float
        Constant torque that acts besides the logged one, in its unit.
    fit : float
        100 (1 − |y − ŷ|/|y − mean y|) of a simulation from the torque alone.
    """

    names: tuple[str, ...]
    theta: Array
    deviations: Array
    offset: float
    fit: float


@dataclass(frozen=True)
class _Problem:
    """A log and the model of its axis."""

    model: Parametrization
    u: Array
    y: Array
    ok: NDArray[np.bool_]
    period: float

    def simulated(self, theta: Array, offset: float) -> tuple[Array, Array]:
        """Return ŷ (N,) and its derivatives (N, p+1) by θ relative to itself, and the offset."""
        y, psi = predict(self.model, theta, self.u + offset, period=self.period)
        nudge = NUDGE * float(np.sqrt(np.mean(self.u**2)))
        other = predict(self.model, theta, self.u + offset + nudge, period=self.period)[0]
        return y, np.column_stack([psi * theta, (other - y) / nudge])


def refit(record: Record, axis: Axis, names: Sequence[str]) -> Refit:
    """Estimate parameters of a known axis, and a constant torque, from one log.

    Output error from rest, the residual modelled as an autoregression and whitened by it, as
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
    theta, offset = problem.model.theta, 0.0
    bounds = np.sort(np.outer(RANGE, theta), axis=0)
    step = np.inf
    for _ in range(STEPS):
        error, psi = _error(problem, theta, offset)
        whitening = _whitening(problem, error)
        step, covariance = _solved(problem, error, psi, whitening)
        theta = np.clip(theta * (1 + np.clip(step[:-1], -FARTHEST, FARTHEST)), *bounds)
        offset += float(step[-1])
        if np.all(abs(step) <= 0.1 * np.sqrt(np.diag(covariance))):
            break
    error, psi = _error(problem, theta, offset)
    whitening = _whitening(problem, error)
    covariance = _solved(problem, error, psi, whitening)[1]
    claimed = np.sqrt(np.diag(covariance))[:-1]
    deviations = np.maximum(claimed, _block_deviations(problem, error, psi, whitening)[:-1])
    fit = 100 * float(1 - np.std(error[problem.ok]) / np.std(problem.y[problem.ok]))
    _check(problem.model.names, theta, bounds, fit)
    return Refit(problem.model.names, theta, deviations * abs(theta), offset, fit)


def seen(record: Record, axis: Axis, names: Sequence[str]) -> tuple[str, ...]:
    """Return which of some parameters a log tells to `SEEN`, all together.

    The one that is told least is left out, until the others are told well enough.
    """
    left = list(names)
    while left:
        problem = _problem(record, axis, left)
        error, psi = _error(problem, problem.model.theta, 0.0)
        covariance = _solved(problem, error, psi, _whitening(problem, error))[1]
        deviations = np.sqrt(np.diag(covariance))[:-1]
        worst = int(np.argmax(deviations))
        if deviations[worst] <= SEEN:
            return tuple(left)
        del left[worst]
    raise LogError("this log tells no parameter to 10 %: excite the axis more, or name --free NAME")


def _problem(record: Record, axis: Axis, names: Sequence[str]) -> _Problem:
    output, period = output_of(record), record.period
    model = increment(axis.model, period) if output == "increment" else axis.model
    u = delayed(record.torque, axis.delay / period, smooth=is_smooth(record))
    y = np.asarray(getattr(record, output))
    return _Problem(model.parametrize(names), u, y, usable(record), period)


def _error(problem: _Problem, theta: Array, offset: float) -> tuple[Array, Array]:
    simulated, psi = problem.simulated(theta, offset)
    if not (np.isfinite(simulated).all() and np.isfinite(psi).all()):
        raise LogError("the simulation of this log runs away with the values of the axis")
    return problem.y - simulated, psi


def _whitening(problem: _Problem, error: Array) -> Array:
    return noise_model(error[problem.ok], HIGHEST_ORDER)


def _whitened(problem: _Problem, error: Array, psi: Array, whitening: Array) -> tuple[Array, Array]:
    ok = settled(problem.ok, len(whitening))
    if ok.sum() <= 10 * psi.shape[1]:
        raise LogError(f"{ok.sum()} usable samples cannot tell {psi.shape[1]} parameters")
    return lfilter(whitening, 1.0, error)[ok], lfilter(whitening, 1.0, psi, axis=0)[ok]


def _solved(problem: _Problem, error: Array, psi: Array, whitening: Array) -> tuple[Array, Array]:
    """Return the Gauss-Newton step of all, and its covariance."""
    e, gradient = _whitened(problem, error, psi, whitening)
    norm = np.maximum(np.linalg.norm(gradient, axis=0), 1e-300)
    inverse = np.linalg.pinv(gradient / norm, rcond=1e-12)
    step = inverse @ e / norm
    variance = float(np.sum((e - gradient @ step) ** 2)) / (len(e) - len(norm))
    return step, variance * inverse @ inverse.T / np.outer(norm, norm)


def _block_deviations(problem: _Problem, error: Array, psi: Array, whitening: Array) -> Array:
    """Return the standard deviations by leaving out a tenth of the log at a time: the jackknife."""
    e, gradient = _whitened(problem, error, psi, whitening)
    norm = np.maximum(np.linalg.norm(gradient, axis=0), 1e-300)
    blocks = np.array_split(np.arange(len(e)), BLOCKS)
    scaled = gradient / norm
    squares = [scaled[b].T @ scaled[b] for b in blocks]
    products = [scaled[b].T @ e[b] for b in blocks]
    square, product = sum(squares), sum(products)
    steps = np.array(
        [
            np.linalg.pinv(square - mine, hermitian=True) @ (product - its)
            for mine, its in zip(squares, products, strict=True)
        ]
    )
    spread = steps - steps.mean(axis=0)
    return np.sqrt((BLOCKS - 1) / BLOCKS * (spread**2).sum(axis=0)) / norm


def _check(names: Sequence[str], theta: Array, bounds: Array, fit: float) -> None:
    stuck = [n for n, at, low, high in zip(names, theta, *bounds, strict=True) if at in (low, high)]
    if stuck:
        raise LogError(
            f"{', '.join(stuck)} would be {RANGE[0]:g} or {RANGE[1]:g} times what is known: is it "
            "a log of this axis, in the same units?"
        )
    if not fit > 0:
        raise LogError(
            f"a simulation from the torque fits by {fit:.0f} % only: is it a log of this axis?"
        )
