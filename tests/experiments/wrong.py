"""Estimators made wrong on purpose, for `flexaxis check` to catch.

They are in no registry and no suite; name them as `tests/experiments/wrong.py:Cheater`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axis_models import PAPER
from flexaxis.estimators.registry import REGISTRY

Array = NDArray[np.float64]


class Honest:
    """The paper's method; the others are made from it."""

    def __init__(
        self,
        nominal: Mapping[str, float],
        period: float,
        *,
        identify: Sequence[str] = PAPER,
        output: str = "speed",
        torque: Array | None = None,
    ) -> None:
        self._inner = REGISTRY["rpem-forgetting"].factory(
            nominal, period, identify=identify, output=output, torque=torque
        )
        self.names, self.output = identify, output

    def step(self, u: float, y: float | None) -> Array:
        """Take one sample, honestly."""
        return self._inner.step(u, y)


class Cheater(Honest):
    """WRONG ON PURPOSE: sees one second into the future, and so has hardly any lag.

    A smoother on a stored log does the same, with good intentions. It is one only in `run`,
    because `step` is not given the future.
    """

    AHEAD = 200  # samples

    def run(self, u: Array, y: Array, *missing: Any) -> Array:
        """Take all samples, and give each estimate one second too early."""
        theta = self._inner.run(u, y, *missing)
        return np.concatenate([theta[self.AHEAD :], np.tile(theta[-1], (self.AHEAD, 1))])[: len(u)]


class Hindsight(Honest):
    """WRONG ON PURPOSE: clips y at twice its standard deviation, taken over the whole record.

    No order of the samples matters to that, and no single one of the future is used; still no
    robot knows today how much its axis will move tomorrow.
    """

    def run(self, u: Array, y: Array, *missing: Any) -> Array:
        """Take all samples, those of y clipped at what is unusual in all of them."""
        usual = 2 * np.std(y)
        return self._inner.run(u, np.clip(y, -usual, usual), *missing)


class Sloppy(Honest):
    """WRONG ON PURPOSE: four mistakes that are easily made.

    The input is late by one sample, the array returned is the one it goes on writing to, y is
    replaced by 0 in a gap, and a reset forgets the filter.
    """

    def __init__(self, nominal: Mapping[str, float], period: float, **known: Any) -> None:
        super().__init__(nominal, period, **known)
        self._before = 0.0
        self._theta = np.zeros(len(self.names))

    def step(self, u: float, y: float | None) -> Array:
        """Take one sample, carelessly."""
        late, self._before = self._before, u
        self._theta[:] = self._inner.step(late, 0.0 if y is None else y)
        return self._theta

    def reset(self) -> None:
        """Return to the start, but not quite."""
        self._before = 0.0
