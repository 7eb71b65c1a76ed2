"""The estimator that never moves: what doing nothing scores."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.entry import Entry
from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.filters.design import OUTPUTS, finite_vector
from flexaxis.estimators.filters.filter import RecursiveEstimator
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.problem import Problem

Array = NDArray[np.float64]


class Frozen(RecursiveEstimator):
    """
    θ̂ = θ(0) for ever. It expects nothing of y, so that it has no innovation.

    Parameters
    ----------
    model : Model
    identify : sequence of str, optional
        Parameters by name, or their inverses; the model's own choice by default.
    theta0 : (p,) array_like, optional
        θ(0); the model's nominal values by default.
    output : {"speed", "increment"}
        What it pretends to read.

    Attributes
    ----------
    covariance : (p, p) array
        Zero: it claims to know.

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
        if output not in OUTPUTS:
            raise EstimatorError(f"unknown output {output!r}: {did_you_mean(output, OUTPUTS)}")
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
        """Return to the start, where it is already."""

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        estimates[:] = self._theta
        trace[:] = np.nan


def _frozen(
    problem: Problem,
) -> Frozen:
    """Make the estimator that never moves."""
    return Frozen(problem.model, identify=problem.identify, output=problem.output)


ENTRIES = (
    Entry("frozen", "never moves: what doing nothing scores", _frozen, rank=99, told_noise=False),
)
