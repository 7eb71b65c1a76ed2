"""The trade-off, a dot a fault: how noisy an estimate was before it, and how late after it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.case import lag, rms
from flexaxis.experiments.scoring.windows import QUIET, WINDOW
from flexaxis.sim.timing import PERIOD, sample_index

Array = NDArray[np.float64]
LEAST = sample_index(2.0, PERIOD)
"""Quiet samples before a fault, and scored ones after it, below which there is no dot."""


@dataclass(frozen=True)
class Point:
    """One fault as one estimator met it.

    Attributes
    ----------
    racer : int
        Which of the racers, from 0.
    label : str
        Its name and tuning then.
    parameter : str
        The estimated parameter that changed.
    std : float
        Root mean square error in the 5 s before the fault [% of nominal].
    lag : float
        Integral of the error over the size of the fault, from the fault for 5 s [s].
    """

    racer: int
    label: str
    parameter: str
    std: float
    lag: float


class Scorer:
    """Turn the errors of all racers, sample by sample, into dots.

    Only samples in which the excitation is on are counted, as in docs/scores.md: in a pause
    nothing can be learnt, so the clock stands.

    Parameters
    ----------
    names : sequence of str
        Estimated parameters.
    nominal : ndarray (p,)
        Their nominal values.
    racers : int
        How many.
    """

    def __init__(self, names: Sequence[str], nominal: Array, racers: int) -> None:
        self._names, self._nominal = tuple(names), nominal
        self._quiet = np.empty((0, racers, len(names)))
        self._scored = self._quiet
        self._fault: tuple[int, float, Array, list[str]] | None = None

    @property
    def open(self) -> bool:
        """Whether a fault is being scored."""
        return self._fault is not None

    def take(self, errors: Array, excited: NDArray[np.bool_]) -> list[Point]:
        """Take errors (n, racers, p) of n samples; return the dots that are complete with them."""
        errors = errors[excited]
        if self._fault is None:
            self._quiet = np.concatenate([self._quiet, errors])[-sample_index(QUIET, PERIOD) :]
            return []
        self._scored = np.concatenate([self._scored, errors])
        return self._finish() if len(self._scored) >= sample_index(WINDOW, PERIOD) else []

    def fault(self, changed: str, size: float, labels: Sequence[str]) -> list[Point]:
        """Begin to score a fault of an estimated parameter; return the dots of the one before.

        Parameters
        ----------
        changed : str
            Name of the estimated parameter.
        size : float
            D = |θ_after − θ_before|.
        labels : sequence of str
            Names and tunings of the racers.
        """
        dots = self.event()
        if len(self._quiet) >= LEAST:
            column = self._names.index(changed)
            std = 100 * rms(self._quiet[:, :, column])
            self._fault = column, size, std / self._nominal[column], list(labels)
        self._quiet = self._quiet[:0]
        return dots

    def event(self) -> list[Point]:
        """End the window because something else has changed; return the dots of what it had."""
        dots = self._finish() if len(self._scored) >= LEAST else []
        self._fault, self._scored = None, self._scored[:0]
        return dots

    def forget_quiet(self) -> None:
        """Begin anew with the time before the next fault: what came before counts no more."""
        self._quiet = self._quiet[:0]

    def _finish(self) -> list[Point]:
        assert self._fault is not None
        column, size, std, labels = self._fault
        scored = self._scored[: sample_index(WINDOW, PERIOD), :, column]
        lags = lag(scored / size, PERIOD)
        self._fault, self._scored = None, self._scored[:0]
        return [
            Point(racer, labels[racer], self._names[column], float(std[racer]), float(lags[racer]))
            for racer in range(len(labels))
        ]
