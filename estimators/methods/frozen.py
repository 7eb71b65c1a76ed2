"""The estimator that never moves: what doing nothing scores."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import OUTPUTS, finite_vector
from flexaxis.estimators.signals import check_sample, check_signals


class Frozen:
    """
    θ̂ = θ(0) for ever.

    Parameters
    ----------
    model : Model
    identify : sequence of str
        Parameters by name, or their inverses.
    theta0 : (p,) array_like, optional
        θ(0); the model's nominal values by default.
    output : {"speed", "increment"}
        What it pretends to read.

    Raises
    ------
    EstimatorError
        If a parameter or the output is unknown, or θ(0) cannot be used.
    """

    def __init__(
        self,
        model: Model,
        *,
        identify: Sequence[str] = ("k_T", "1/J_a", "f_m"),
        theta0: ArrayLike | None = None,
        output: str = "speed",
    ) -> None:
        if output not in OUTPUTS:
            raise EstimatorError(f"unknown output {output!r}: {did_you_mean(output, OUTPUTS)}")
        parametrization = model.parametrize(identify)
        self.names, self.output = parametrization.names, output
        start = parametrization.theta if theta0 is None else theta0
        self.theta = finite_vector("theta0", start, len(self.names))

    def reset(self) -> None:
        """Return to the start, where it is already."""

    def step(self, u: float, y: float | None) -> NDArray[np.float64]:
        """Take one sample and return θ(0) (p,)."""
        check_sample(u, y)
        return self.theta.copy()

    def run(
        self, u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Take N samples and return θ(0) in every row (N, p)."""
        u, _, _ = check_signals(u, y, valid)
        return np.tile(self.theta, (len(u), 1))
