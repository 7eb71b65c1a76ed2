"""After a parameter change, compare the errors of two estimators with the Cramér–Rao bound.

The errors and bounds include only samples at which the reference moves (see docs/scores.md).
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
    """Estimation errors of two estimators after a parameter change, and lower bounds of the errors.

    Each error is divided by the size of the change. The relative error is close to 1 just after the
    change, and 0 for a correct estimate. If an estimator does not estimate the changed parameter,
    the error is always 1.

    Parameters
    ----------
    axis : LiveAxis
        Axis after the change.
    what : str
        Description of the change.
    before : ndarray (4,)
        True values of the parameters in `SHOWN` before the change.

    Attributes
    ----------
    at : int
        Index of the first sample after the change.
    parameter : str or None
        Name of the parameter in `SHOWN` with the largest relative change, or None if no parameter
        has changed.
    curves : ndarray (n, 4)
        Absolute errors of both estimators, and two Cramér–Rao bounds of the mean absolute error, at
        each sample of the first 5 s after the change. The first bound assumes that the estimator
        knows which parameter has changed. The second bound assumes that the estimator does not know
        the changed parameter. Both bounds assume that the estimator knows the time of the change.
        If a bound is not defined, its values are NaN.
    findings : list of str
        Description of the change that each estimator has detected.
    """

    def __init__(self, axis: LiveAxis, what: str, before: Array) -> None:
        self.at, self.what = axis.samples, what
        self._truth = axis.theta(SHOWN)
        sizes = np.abs(self._truth - before)
        self._column = int(np.argmax(sizes / np.maximum(np.abs(self._truth + before), 1e-9)))
        self._size = float(sizes[self._column])
        self.parameter = SHOWN[self._column] if self._size else None
        # False if the change has removed the dry friction
        known = SHOWN[self._column] in tracked(axis.scenario, NAMES)
        self._bounded = known and np.count_nonzero(sizes) == 1 and axis.variance > 0
        self._where = axis.scenario, axis.values, axis.state, axis.variance
        self.curves = np.full((0 if self.parameter else 1, 4), np.nan)
        self._torque = np.empty(0)
        self.findings = ["", ""]

    @property
    def open(self) -> bool:
        """Whether the curves are still incomplete; if so, `take` appends further samples."""
        return self.parameter is not None and len(self.curves) < LENGTH

    @property
    def lags(self) -> Array:
        """Integrals of the four curves from the time of the change to the last sample [s]."""
        return np.asarray(lag(self.curves, PERIOD))

    def take(self, estimates: Sequence[Array], torque: Array, excited: NDArray[np.bool_]) -> None:
        """Append the estimation errors at the next samples to the curves.

        Parameters
        ----------
        estimates : sequence of ndarray (n, 4)
            Estimates of the parameters in `SHOWN` from each estimator.
        torque : ndarray (n,)
            Torque [N m].
        excited : ndarray (n,)
            Whether the reference moves at each sample.
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
