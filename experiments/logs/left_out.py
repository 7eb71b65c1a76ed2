"""What a model leaves out of an axis: torques that it has not got, and how much they explain.

What a rich model of the noise is for, it also does with what the axis is and the model is not:
residuals come out white, and numbers wrong. So those torques are tried that an axis may well have
and a linear model has not. Each would move the output by what the linear model makes of it, and
whether residuals hold that is a score test (C. R. Rao, *Large sample tests of statistical
hypotheses concerning several parameters*, Proc. Camb. Phil. Soc. 44, 1948): a regression of the
white residuals on it and on the derivatives by all that was fitted, without another fit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.prediction_error import Fitted
from flexaxis.experiments.logs.attempt import Attempt
from flexaxis.experiments.logs.friction import linear_part
from flexaxis.experiments.logs.pieces import LEAST_GAIN, jackknife

Array = NDArray[np.float64]

CERTAIN = 5.0  # standard deviations, of six torques tried with ten pieces: one chance in a hundred
MOTOR = "speed_motor"

Torque = tuple[str, str, Array]


@dataclass(frozen=True)
class LeftOut:
    """A torque that was tried.

    Attributes
    ----------
    what : str
        In words.
    advice : str
        What to do about it.
    gain : float
        Gain of the logarithm of the likelihood of a sample.
    sure : float
        Its size, in standard deviations from its spread over pieces.
    name, moves : str, float
        Which estimate it moves most, and by how many of its standard deviations.
    """

    what: str
    advice: str
    gain: float
    sure: float
    name: str
    moves: float

    @property
    def there(self) -> bool:
        """Whether it predicts the log better, by as much as a law of friction is taken for."""
        return self.gain > LEAST_GAIN and self.sure > CERTAIN


def left_out(attempt: Attempt, fitted: Fitted, deviations: Array) -> tuple[LeftOut, ...]:
    """Return what each torque would explain of the residuals, the most first.

    Parameters
    ----------
    attempt, fitted
    deviations : ndarray (q,)
        Of the unknowns.
    """
    model = attempt.having(attempt.values(fitted)).model
    if MOTOR not in model.states or not np.isfinite(fitted.square):
        return ()
    moved = _moved(attempt, fitted)
    found = [_tried(attempt, fitted, deviations, each) for each in moved]
    return tuple(sorted(found, key=lambda each: (not each.there, -each.gain)))


def _tried(attempt: Attempt, fitted: Fitted, deviations: Array, torque: Torque) -> LeftOut:
    """Return what a torque explains, by its ways (m, N) of moving the output."""
    what, advice, ways = torque
    free = np.flatnonzero(_free(attempt, fitted))
    J = np.vstack([fitted.slopes[free], fitted.colour.white(ways)])
    step, pieces = jackknife(J, fitted.white, fitted.good)
    m, good = len(ways), fitted.good
    left = fitted.white[good] - step @ J[:, good]
    gain = 0.5 * float(np.log(fitted.square / np.mean(left**2)))
    shares = abs(step[:-m]) / np.maximum(deviations[free], np.finfo(float).tiny)
    shares[free >= len(attempt.names)] = 0.0
    most = int(np.argmax(shares))
    name = attempt.names[free[most]] if shares[most] > 0 else ""
    sure = float(np.max(abs(step[-m:]) / np.maximum(pieces[-m:], np.finfo(float).tiny)))
    return LeftOut(what, advice, gain, sure, name, float(shares[most]))


def _free(attempt: Attempt, fitted: Fitted) -> NDArray[np.bool_]:
    """Return which unknowns may move either way."""
    problem = attempt.problem()
    inside = (fitted.z > problem.lower) & (fitted.z < problem.upper)
    return inside & (np.diag(fitted.covariance) > 0)


def _moved(attempt: Attempt, fitted: Fitted) -> Iterator[Torque]:
    """Return words, advice, and what torques make of the output (m, N)."""
    log = attempt.log
    model = attempt.having(attempt.values(fitted)).model
    linear = linear_part(model)
    form = linear.parametrize(linear.parameters)
    A, B, C = (np.asarray(part, float) for part in form.matrices(form.theta)[:3])
    B, C = B.reshape(len(A)), C.reshape(len(A))
    simulated = np.where(log.ok, log.y - fitted.residual, 0.0)
    level = float(model.nominal.get("f_c", 0.0)) / float(model.nominal.get("k_T", 1.0))
    torque = log.u + fitted.z[-2] - level * np.sign(simulated)
    x = _along(A, B[:, None], torque[None], log.period)[:, : len(A), 0]
    angle = np.cumsum(np.where(log.ok, log.y, simulated)) * log.period
    for what, advice, column, ways in _torques(linear, A, B, x, angle):
        held = 0.5 * (ways + np.c_[ways[:, 1:], ways[:, -1:]])
        found = _along(A, np.tile(column[:, None], len(ways)), held, log.period, C)
        turned = found[:, len(A)]
        if log.output == "speed":
            yield what, advice, np.einsum("i,kij->jk", C, found[:, : len(A)])
        else:
            yield what, advice, np.diff(turned, axis=0, prepend=0.0).T / log.period


def _torques(
    linear: Model, A: Array, B: Array, x: Array, angle: Array
) -> Iterator[tuple[str, str, Array, Array]]:
    """Return words, advice, the column of ẋ that a torque acts by, and its ways (m, N)."""
    states = linear.states
    for j, state in enumerate(states):
        if state.startswith("twist"):
            bent = x[:, j] / max(float(np.std(x[:, j])), np.finfo(float).tiny)
            yield (
                f"a spring that is stiffer or softer the more it is bent ({state}), such as one "
                "with backlash",
                "log larger or smaller motion, and take k for the one of that motion only",
                A[:, j],
                bent[None] ** 3,
            )
        elif state.startswith("speed") and state != MOTOR:
            yield (
                f"dry friction at {state.removeprefix('speed_')}, which the model takes for "
                "viscous friction and what else is near it",
                "no law of --friction acts there; reduce it, or log motion that is fast beside it",
                np.eye(len(states))[j],
                np.sign(x[:, j])[None],
            )
    turns = angle * linear.nominal.get("r", 1.0)
    yield (
        "a torque that depends on the angle, such as gravity",
        "log about an angle at which it hardly changes, or take it from the column of the torque",
        B,
        np.array([np.sin(turns), np.cos(turns)]),
    )


def _along(A: Array, columns: Array, held: Array, period: float, C: Array | None = None) -> Array:
    """Return states (N, n + 1, m), the angle last, from rest under m torques (m, N) held."""
    n, m = len(A), columns.shape[1]
    full = np.zeros((n + 1 + m, n + 1 + m))
    full[:n, :n], full[:n, n + 1 :] = A, columns
    full[n, :n] = 0.0 if C is None else C
    step = expm(full * period)
    over, gain = step[: n + 1, : n + 1], step[: n + 1, n + 1 :]
    x = np.zeros((held.shape[1], n + 1, m))
    for k in range(1, len(x)):
        x[k] = over @ x[k - 1] + gain * held[:, k - 1]
    return x
