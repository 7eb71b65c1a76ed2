"""A control: the paper's method, told when the parameters change."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.entry import Entry
from flexaxis.estimators.filters.design import above_zero
from flexaxis.estimators.filters.filter import RecursiveEstimator
from flexaxis.estimators.filters.prediction_error import LINEAR
from flexaxis.estimators.methods.paper import rpem_corrected
from flexaxis.estimators.methods.rpem import Rpem
from flexaxis.estimators.problem import Problem

Array = NDArray[np.float64]

SPREAD = 0.5  # of a change of which nothing is known, relative to θ: from half to one and a half


class OracleReset(RecursiveEstimator):
    """
    State-corrected RPEM that begins anew at the true times of change.

    No estimator that can be used: it shows what detection alone would be worth.

    Parameters
    ----------
    rpem : Rpem
        The filter, with state correction.
    onsets : sequence of int
        Samples of the changes.
    spread : float
        Standard deviation of a change, relative to θ.

    Attributes
    ----------
    names, output, bounds, theta, covariance, …
        Those of the filter.
    """

    _shared = (*RecursiveEstimator._shared, "_onsets")

    def __init__(self, rpem: Rpem, *, onsets: Sequence[int], spread: float = SPREAD) -> None:
        above_zero("spread", spread, "a standard deviation relative to θ")
        super().__init__(rpem.names, rpem.output, rpem.bounds)
        self._rpem, self._onsets, self._spread = rpem.copy(), sorted(onsets), spread
        self.reset()

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._rpem.theta

    @property
    def covariance(self) -> Array:  # noqa: D102
        return self._rpem.covariance

    def _start(self) -> None:
        self._rpem.reset()
        self._count = 0

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        first = self._count
        inside = [onset - first for onset in self._onsets if first <= onset < first + len(u)]
        for start, stop in zip([0, *inside], [*inside, len(u)], strict=True):
            if start in inside:
                # y[onset] is still that of the old parameters; what is held from here on is not
                # a wide prior makes an error of second order, which is no less than some of y
                finest = LINEAR**2 * self._rpem.signal_power
                noise = max(self._rpem.noise_variance, finest)
                self._rpem.restart((self._spread * self._rpem.theta) ** 2 / noise)
            part = slice(start, stop)
            self._rpem._take(u[part], y[part], valid[part], estimates[part], trace[part])
        self._count += len(u)


def _oracle_reset(
    problem: Problem,
    *,
    onsets: Sequence[int] = (),
    forgetting: float | None = None,
    spread: float = SPREAD,
) -> OracleReset:
    """
    Make the control that is told the samples at which a true parameter changes, and the noise.

    Parameters
    ----------
    onsets : sequence of int
        Samples of the changes.
    forgetting : float, optional
        λ of a sample.
    spread : float
        Standard deviation of a change, relative to θ.
    """
    weight = problem.factor("oracle-reset", forgetting)
    rpem = rpem_corrected(problem, forgetting=weight)
    return OracleReset(rpem, onsets=onsets, spread=spread)


ENTRIES = (
    Entry(
        "oracle-reset",
        "a control that is told when a fault happens, and begins anew there",
        _oracle_reset,
        knob="1-forgetting",
        default=0.995,
        rank=98,
    ),
)
