"""Two baselines: a constant estimate, and a prediction-error method restarted at each change."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.design import above_zero
from flexaxis.estimators.filters.filter import RecursiveEstimator
from flexaxis.estimators.filters.prediction_error import CALM, LINEAR, ROBUST
from flexaxis.estimators.methods.rpem import Rpem
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry
from flexaxis.estimators.signals import find_signal

Array = NDArray[np.float64]


class Frozen(RecursiveEstimator):
    """
    A baseline estimator whose estimate is always the initial value θ(0).

    The baseline does not predict y and therefore has no innovations.

    Parameters
    ----------
    model : Model
    identify : sequence of str, optional
        Names of the identified parameters or inverse parameters; by default, the names in the
        model's attribute ``identify``.
    output : {"speed", "increment", "angle"}
        Type of the output signal y, which the baseline ignores.

    Attributes
    ----------
    covariance : (p, p) array
        Claimed covariance of the constant estimate, which is zero.

    Raises
    ------
    EstimatorError
        If the name of a parameter or of the output is unknown.
    """

    def __init__(
        self,
        model: Model,
        *,
        identify: Sequence[str] | None = None,
        output: str = "speed",
    ) -> None:
        find_signal(output)
        parametrization = model.parametrize(identify)
        self._theta = parametrization.theta
        super().__init__(parametrization.names, output)

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._theta.copy()

    @property
    def covariance(self) -> Array:  # noqa: D102
        return np.diag(0 * self._theta)

    def _start(self) -> None:
        """Do nothing, because the constant estimate never changes."""

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        estimates[:] = self._theta
        trace[:] = np.nan


def _frozen(problem: Problem) -> Frozen:
    """Return the baseline estimator with a constant estimate."""
    return Frozen(problem.model, identify=problem.identify, output=problem.output)


SPREAD = 0.5  # standard deviation of an unknown change relative to θ, for factors of 0.5 to 1.5


class OracleReset(Rpem):
    """
    The recursive prediction-error method (RPEM), restarted at each true parameter change.

    The method corrects the state when the estimate of θ changes. In practice the times of parameter
    changes are unknown. The estimator is therefore only a baseline that shows the benefit of
    perfect change detection.

    Parameters
    ----------
    problem : Problem
        Estimation problem with nominal values and sampling period.
    onsets : sequence of int
        Indices of the samples at which parameters change.
    forgetting : float, optional
        Forgetting factor λ per sample.
    spread : float
        Assumed standard deviation of a parameter change, relative to θ.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        onsets: Sequence[int] = (),
        forgetting: float | None = None,
        spread: float = SPREAD,
    ) -> None:
        self._onsets = sorted(onsets)
        self._spread = above_zero("spread", spread, "the standard deviation of a parameter change")
        super().__init__(
            problem.model,
            **problem.forgetting_options("oracle-reset", forgetting),
            state_correction=True,
            robust=ROBUST,
            ceiling=CALM,
        )

    def _start(self) -> None:
        super()._start()
        self._count = 0

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        first = self._count
        inside = [onset - first for onset in self._onsets if first <= onset < first + len(u)]
        for start, stop in zip([0, *inside], [*inside, len(u)], strict=True):
            if start in inside:
                # y[onset] still depends on the old parameters; the torque held from now on acts on
                # the new ones. A wide prior causes an error of second order, at least LINEAR × y
                noise = max(self.noise_variance, LINEAR**2 * self.state["signal"])
                self.restart((self._spread * self.theta) ** 2 / noise)
            part = slice(start, stop)
            super()._take(u[part], y[part], valid[part], estimates[part], trace[part])
        self._count += len(u)


ENTRIES = (
    Entry(
        "frozen",
        "a baseline estimator with a constant estimate",
        _frozen,
        rank=99,
        told_noise=False,
    ),
    Entry(
        "oracle-reset",
        "a baseline estimator: rpem-forgetting, restarted at the true time of each fault",
        OracleReset,
        knob="1-forgetting",
        default=0.995,
        rank=98,
    ),
)
