"""One change of the axis, and how the two estimators follow it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.demo.bound import Allowed, Jump, allowed
from flexaxis.experiments.demo.racer import NAMES, SHOWN
from flexaxis.experiments.scoring.case import lag
from flexaxis.experiments.scoring.windows import WINDOW
from flexaxis.sim.timing import PERIOD, sample_index

Array = NDArray[np.float64]

LENGTH = sample_index(WINDOW, PERIOD)


class Pursuit:
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
    """

    def __init__(self, before: Array, after: Array, racers: int, jump: Jump | None = None) -> None:
        self.before, self.after = before, after
        self.changed, self.size = changed(before, after)
        self.open = True
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

    def close(self) -> None:
        """Take no more: something else has changed."""
        self.open = False

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
