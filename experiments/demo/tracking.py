"""One change of the axis: the errors of both estimators after it, and the Cramér–Rao bound.

Only samples in which the reference moves count, as docs/scores.md explains.
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
    """Errors of both estimators since a change, and their lower bound.

    Errors are divided by the size of the change: they start near 1, and 0 is the true value. For an
    estimator that does not estimate the changed parameter, the error stays at 1.

    Parameters
    ----------
    axis : LiveAxis
        The axis after the change.
    what : str
        Description of the change.
    before : ndarray (4,)
        True values of `SHOWN` before the change.

    Attributes
    ----------
    at : int
        First sample after the change.
    parameter : str or None
        The parameter of `SHOWN` that changed most; None if none of them changed.
    curves : ndarray (n, 4)
        Mean absolute errors for at most 5 s: of both estimators, and by the Cramér–Rao bound for an
        estimator that knows which parameter changed and for one that does not. Both bounds assume
        a known time of the change. NaN if no bound is defined.
    findings : list of str
        The change that each estimator reported, in words.
    """

    def __init__(self, axis: LiveAxis, what: str, before: Array) -> None:
        self.at, self.what = axis.samples, what
        self._truth = axis.theta(SHOWN)
        sizes = np.abs(self._truth - before)
        self._column = int(np.argmax(sizes / np.maximum(np.abs(self._truth + before), 1e-9)))
        self._size = float(sizes[self._column])
        self.parameter = SHOWN[self._column] if self._size else None
        known = SHOWN[self._column] in tracked(axis.scenario, NAMES)  # False for removed friction
        self._bounded = known and np.count_nonzero(sizes) == 1 and axis.noise > 0
        self._where = axis.scenario, axis.values, axis.state, axis.noise**2
        self.curves = np.full((0 if self.parameter else 1, 4), np.nan)
        self._torque = np.empty(0)
        self.findings = ["", ""]

    @property
    def open(self) -> bool:
        """Whether the change is still recorded."""
        return self.parameter is not None and len(self.curves) < LENGTH

    @property
    def lags(self) -> Array:
        """Integrals of the curves up to now (4,) [s]."""
        return np.asarray(lag(self.curves, PERIOD))

    def take(self, estimates: Sequence[Array], torque: Array, excited: NDArray[np.bool_]) -> None:
        """Append samples.

        Parameters
        ----------
        estimates : sequence of ndarray (n, 4)
            Estimates of `SHOWN` by both estimators.
        torque : ndarray (n,)
            Torque [N m].
        excited : ndarray (n,)
            Whether the reference moves.
        """
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
