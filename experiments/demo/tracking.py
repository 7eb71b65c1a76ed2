"""One change of the axis: how two estimators follow it, and what the Cramér–Rao bound allows.

Only samples in which the reference moves count, as in docs/scores.md.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.demo.axis import LiveAxis
from flexaxis.experiments.demo.racer import NAMES, SHOWN
from flexaxis.experiments.scoring.bounds import bound_from
from flexaxis.experiments.scoring.scores import lag
from flexaxis.experiments.scoring.true_model import tracked
from flexaxis.experiments.scoring.windows import WINDOW
from flexaxis.sim.timing import PERIOD, sample_index

Array = NDArray[np.float64]
LENGTH = sample_index(WINDOW, PERIOD)


class Change:
    """Errors of both estimators since a change, and the bound on them.

    An error is relative to the size of the change: it is 1 at first, and 0 at the truth. For an
    estimator without the parameter it stays at 1.

    Parameters
    ----------
    axis : LiveAxis
        After the change.
    what : str
        In words.
    before : ndarray (4,)
        True values of `SHOWN` before it.

    Attributes
    ----------
    at : int
        First sample after it.
    parameter : str or None
        Which of `SHOWN` changed, the one that changed most; None if none did.
    curves : ndarray (n, 4)
        Errors of both estimators, for at most 5 s, and two that the Cramér–Rao bound allows on
        the mean: for an estimator that knows which parameter changed, and for one that does not;
        both know when. NaN where no bound is defined.
    findings : list of str
        What each estimator reported.
    """

    def __init__(self, axis: LiveAxis, what: str, before: Array) -> None:
        self.at, self.what = axis.samples, what
        self._truth = axis.theta(SHOWN)
        sizes = np.abs(self._truth - before)
        self._column = int(np.argmax(sizes / np.maximum(np.abs(self._truth + before), 1e-9)))
        self._size = float(sizes[self._column])
        self.parameter = SHOWN[self._column] if self._size else None
        known = SHOWN[self._column] in tracked(axis.scenario, NAMES)  # not friction that is gone
        self._bounded = known and np.count_nonzero(sizes) == 1 and axis.noise > 0
        self._where = axis.scenario, axis.values, axis.state, axis.noise**2
        self.curves = np.full((0 if self.parameter else 1, 4), np.nan)
        self._torque = np.empty(0)
        self.findings = ["", ""]

    @property
    def open(self) -> bool:
        """Whether it is still followed."""
        return self.parameter is not None and len(self.curves) < LENGTH

    @property
    def lags(self) -> Array:
        """Integral of the curves so far (4,) [s]."""
        return np.asarray(lag(self.curves, PERIOD))

    def take(self, estimates: Sequence[Array], torque: Array, excited: NDArray[np.bool_]) -> None:
        """Take estimates (n, 4) of both, the torque (n,), and whether the reference moves (n,)."""
        if not self.open:
            return
        shown = np.stack([theta[excited, self._column] for theta in estimates], axis=1)
        error = np.abs(shown - self._truth[self._column]) / self._size
        error = np.where(np.isnan(error), 1.0, error)
        error = np.concatenate([self.curves[:, :2], error])[:LENGTH]
        self._torque = np.concatenate([self._torque, torque])[:LENGTH]
        self._bounded = self._bounded and bool(excited.all())
        bound = self._bound() if self._bounded else np.full_like(error, np.nan)
        self.curves = np.hstack([error, bound])

    def _bound(self) -> Array:
        scenario, values, state, variance = self._where
        names = tracked(scenario, NAMES)
        result = bound_from(scenario, names, values, state, self._torque, variance=variance)
        i = names.index(self.parameter)
        deviations = np.stack([result.single[:, i], result.unknown[:, i]], axis=1)
        return np.minimum(1.0, np.sqrt(2 / np.pi) * deviations / self._size)
