"""Controls: a constant estimate, and the paper's method reset at the true times of change."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.filters.design import above_zero, finite_vector
from flexaxis.estimators.filters.filter import RecursiveEstimator
from flexaxis.estimators.filters.prediction_error import LINEAR
from flexaxis.estimators.methods.rpem import Rpem, rpem_forgetting
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry
from flexaxis.estimators.signals import find_signal

Array = NDArray[np.float64]


class Frozen(RecursiveEstimator):
    """
    A control with the constant estimate θ̂ = θ(0), which does not predict y and has no innovation.

    Parameters
    ----------
    model : Model
    identify : sequence of str, optional
        Names of parameters, or their inverses; the model's attribute ``identify`` by default.
    theta0 : (p,) array_like, optional
        Estimate θ(0); the model's nominal values by default.
    output : {"speed", "increment", "angle"}
        Kind of signal y, which the estimator ignores.

    Attributes
    ----------
    covariance : (p, p) array
        Claimed covariance of the estimate, which is zero.

    Raises
    ------
    EstimatorError
        If a parameter or the output is unknown, or θ(0) cannot be used.
    """

    def __init__(
        self,
        model: Model,
        *,
        identify: Sequence[str] | None = None,
        theta0: ArrayLike | None = None,
        output: str = "speed",
    ) -> None:
        find_signal(output)
        parametrization = model.parametrize(identify)
        start = parametrization.theta if theta0 is None else theta0
        self._theta = finite_vector("theta0", start, len(parametrization.names))
        super().__init__(parametrization.names, output, (self._theta, self._theta))

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._theta.copy()

    @property
    def covariance(self) -> Array:  # noqa: D102
        return np.zeros((len(self.names),) * 2)

    def _start(self) -> None:
        """Do nothing, because the estimator never changes."""

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        estimates[:] = self._theta
        trace[:] = np.nan


def _frozen(
    problem: Problem,
) -> Frozen:
    """Make the estimator with a constant estimate."""
    return Frozen(problem.model, identify=problem.identify, output=problem.output)


SPREAD = 0.5  # standard deviation of an unknown change, relative to θ: factors of 0.5 to 1.5


class OracleReset(RecursiveEstimator):
    """
    State-corrected RPEM that is restarted at the true times of change.

    This estimator cannot be used in practice. It shows the benefit of perfect detection.

    Parameters
    ----------
    rpem : Rpem
        Prediction-error filter with state correction.
    onsets : sequence of int
        Samples at which parameters change.
    spread : float
        Standard deviation of a change, relative to θ.

    Attributes
    ----------
    names, output, bounds, theta, covariance, …
        Attributes of the prediction-error filter.
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
                # y[onset] still depends on the old parameters; the torque held from here on acts on
                # the new ones. A wide prior causes an error of second order, at least LINEAR × y
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
    Make the control that receives the samples at which a true parameter changes, and the noise.

    Parameters
    ----------
    onsets : sequence of int
        Samples at which parameters change.
    forgetting : float, optional
        Forgetting factor λ per sample.
    spread : float
        Standard deviation of a change, relative to θ.
    """
    weight = problem.factor("oracle-reset", forgetting)
    rpem = rpem_forgetting(problem, forgetting=weight, state_correction=True)
    return OracleReset(rpem, onsets=onsets, spread=spread)


ENTRIES = (
    Entry("frozen", "constant: the score of doing nothing", _frozen, rank=99, told_noise=False),
    Entry(
        "oracle-reset",
        "a control that is restarted at the true times of faults",
        _oracle_reset,
        knob="1-forgetting",
        default=0.995,
        rank=98,
    ),
)
