"""One change of the axis: how the two estimators follow it, and what theory allows.

Only samples in which the excitation is on are counted, as in docs/scores.md: in a pause nothing can
be learnt, so the clock stands.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.demo.racer import NAMES, SHOWN
from flexaxis.experiments.scoring.bounds import bound_from, lag_bound
from flexaxis.experiments.scoring.scores import lag
from flexaxis.experiments.scoring.true_model import tracked
from flexaxis.experiments.scoring.windows import WINDOW
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.timing import PERIOD, sample_index

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Jump:
    """A jump of one parameter, and where the axis was.

    Attributes
    ----------
    scenario : Scenario
        Laws of the axis.
    values : mapping of str to float
        All parameters after it.
    parameter : str
        The tracked parameter that has jumped, such as ``"1/J_a"``.
    size : float
        D = |θ_after − θ_before|.
    state : ndarray (5,)
        Of the axis, as `LiveAxis.state`; bristles begin anew, for they forget in milliseconds.
    noise : float
        Standard deviation of the measured speed [rad/s], more than zero.
    """

    scenario: Scenario
    values: Mapping[str, float]
    parameter: str
    size: float
    state: Array
    noise: float


@dataclass(frozen=True)
class Allowed:
    """Bounds after a jump.

    Attributes
    ----------
    error : ndarray (n, 2)
        Mean size of the error over that of the jump, n samples after it: for whoever knows which
        parameter has jumped, and for whoever does not.
    lag : tuple of float
        The same two, as lags up to the last of the samples [s].
    """

    error: Array
    lag: tuple[float, float]


def allowed(jump: Jump, torque: ArrayLike) -> Allowed:
    """Return what noise allows to whoever is told time and state of a jump.

    Parameters
    ----------
    jump : Jump
    torque : (n,) array_like
        Command from the jump on [N m].
    """
    scenario, names = jump.scenario, tracked(jump.scenario, NAMES)
    parameters = np.array([jump.values[name] for name in scenario.parameter_names])
    u, variance = np.asarray(torque, float), jump.noise**2
    found = bound_from(scenario, names, parameters, jump.state, u, variance=variance)
    i = names.index(jump.parameter)
    deviations = np.stack([found.single[:, i], found.unknown[:, i]], axis=1)
    lags = [lag_bound(each, jump.size, period=PERIOD) for each in deviations.T]
    error = np.minimum(1.0, np.sqrt(2 / np.pi) * deviations / jump.size)
    return Allowed(error=error, lag=(lags[0], lags[1]))


LENGTH = sample_index(WINDOW, PERIOD)
LEAST = sample_index(2.0, PERIOD)
"""Quiet samples before a fault, and scored ones after it, below which it gives no point."""


@dataclass(frozen=True)
class Point:
    """One fault as one estimator met it: a point of the trade-off.

    Attributes
    ----------
    racer : int
        Which of the racers, from 0.
    parameter : str
        The estimated parameter that changed.
    std : float
        Root mean square error in the 5 s before the fault [% of nominal].
    lag : float
        Integral of the error over the size of the fault, from the fault for 5 s [s].
    """

    racer: int
    parameter: str
    std: float
    lag: float


class Tracking:
    """Errors of the racers since a change, for as long as it is scored.

    An error is counted in sizes of the change: 1 is where the estimate was, 0 the truth. Who does
    not estimate what has changed stays at 1. After a change of what nobody estimates it is the
    largest relative error that the change leads to.

    Parameters
    ----------
    before, after : ndarray (4,)
        True values of `SHOWN`.
    racers : int
        How many.
    jump : Jump or None
        For the bound, where there is one.

    Attributes
    ----------
    changed : str or None
        Which of `SHOWN` has changed; the one that changed most, if several.
    size : float
        D, its change.
    open : bool
        Whether it still takes samples.
    std : ndarray (racers,) or None
        How noisy each racer was before it [% of nominal], where it gives a point.
    """

    def __init__(self, before: Array, after: Array, racers: int, jump: Jump | None = None) -> None:
        self.before, self.after = before, after
        self.changed, self.size = changed(before, after)
        self.open = True
        self.std: Array | None = None
        self._jump = jump
        self._error = np.empty((LENGTH, racers))
        self._torque = np.empty(LENGTH)
        self._n = 0
        self._allowed: Allowed | None = None

    def take(self, theta: Sequence[Array], torque: Array, excited: NDArray[np.bool_]) -> None:
        """Take estimates (n, 4) of each racer, the torque (n,), and whether the axis is moved."""
        if not self.open:
            return
        if not excited.all():
            self._jump = None  # the clock stands in a pause, and the bound knows of none
        room = np.flatnonzero(excited)[: LENGTH - self._n]
        stop = self._n + len(room)
        for racer, values in enumerate(theta):
            self._error[self._n : stop, racer] = self._relative(values[room])
        self._torque[self._n : stop] = torque[room]
        self._n = stop
        self.open = stop < LENGTH

    @property
    def time(self) -> Array:
        """Time since the change of each sample that was taken (n,) [s]."""
        return np.arange(1.0, self._n + 1) * PERIOD

    @property
    def error(self) -> Array:
        """Errors over the size of the change (n, racers)."""
        found: Array = self._error[: self._n]
        return found

    @property
    def lags(self) -> list[float]:
        """Integral of each racer's error over the size of the change, so far [s]."""
        return [float(lag(column, PERIOD)) for column in self.error.T] if self.changed else []

    @property
    def allowed(self) -> Allowed | None:
        """What theory allows, so far; None where no bound is defined."""
        if self._jump is None or self._n < 2:
            return None
        if self._allowed is None or len(self._allowed.error) < self._n:
            self._allowed = allowed(self._jump, self._torque[: self._n])
        return self._allowed

    @property
    def scored(self) -> bool:
        """Whether it will give points."""
        return self.open and self.std is not None

    def close(self) -> list[Point]:
        """Take no more, and return the points that it has given, once."""
        std, self.std, self.open = self.std, None, False
        if std is None or self.changed is None or self._n < LEAST:
            return []
        pairs = zip(std.tolist(), self.lags, strict=True)
        return [Point(racer, self.changed, *pair) for racer, pair in enumerate(pairs)]

    def _relative(self, theta: Array) -> Array:
        if self.changed is not None:
            column = SHOWN.index(self.changed)
            error = np.abs(theta[:, column] - self.after[column]) / self.size
            return np.where(np.isnan(error), 1.0, error)
        p = len(NAMES)
        return np.asarray(np.max(np.abs(theta[:, :p] / self.after[:p] - 1), axis=1))


def changed(before: Array, after: Array) -> tuple[str | None, float]:
    """Return which of `SHOWN` has changed most, relative to its size, and by how much."""
    size = np.abs(after - before)
    if not size.any():
        return None, 0.0
    scale = np.maximum(np.abs(before), np.abs(after))
    column = int(np.argmax(np.divide(size, scale, out=np.zeros_like(size), where=scale > 0)))
    return SHOWN[column], float(size[column])
