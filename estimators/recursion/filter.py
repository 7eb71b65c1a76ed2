"""A compiled loop with its records, as an estimator."""

from collections.abc import Callable
from copy import deepcopy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.signals import check_sample, check_signals

Array = NDArray[np.float64]


class CompiledFilter:
    """
    What `flexaxis.estimators.methods.ukf.joint_ukf` and others make.

    Parameters
    ----------
    loop : callable
        ``loop(tuning, state, u, y, valid, estimates)`` takes N samples, from ``state`` and back
        into it, and writes θ to ``estimates`` (N, p).
    tuning, start
        Its first two arguments, as they are before the first sample.
    design : Design
        Names, output and box.
    read : callable
        ``read(state)`` gives the estimate (p,) and the covariance (p, p) that it claims.

    Attributes
    ----------
    names : tuple of str
        The identified parameters.
    output : {"speed", "increment"}
        What y is.
    bounds : (lower, upper)
        The box in use.
    theta : (p,) array
        The estimate.
    covariance : (p, p) array
        Its claimed covariance.
    state
        What the loop left, in the form of the module that made the filter.
    """

    def __init__(
        self,
        loop: Callable[..., None],
        tuning: Any,
        start: Any,
        design: Design,
        read: Callable[[Any], tuple[Array, Array]],
    ) -> None:
        self.names, self.output = design.model.names, design.output
        self.bounds = design.lower, design.upper
        self._loop, self._tuning, self._start, self._read = loop, tuning, start, read
        self._sample = np.empty(1), np.empty(1), np.empty(1, bool), np.empty((1, len(self.names)))
        self.reset()

    def reset(self) -> None:
        """Return to the start."""
        self.state = deepcopy(self._start)

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._read(self.state)[0].copy()

    @property
    def covariance(self) -> Array:  # noqa: D102
        return self._read(self.state)[1].copy()

    def step(self, u: float, y: float | None) -> Array:
        """
        Take one sample and return θ[k] (p,).

        Parameters
        ----------
        u : float
            Torque held from t_k on.
        y : float or None
            Output measured at t_k; None in a gap.
        """
        check_sample(u, y)
        sample = self._sample
        sample[0][0], sample[1][0], sample[2][0] = u, 0.0 if y is None else y, y is not None
        self._loop(self._tuning, self.state, *sample)
        return sample[3][0].copy()

    def run(self, u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None) -> Array:
        """
        Take N samples, from the current state on, and return θ (N, p).

        Parameters
        ----------
        u, y : (N,) array_like
        valid : (N,) array_like of bool, optional
            False where y is missing.
        """
        u, y, present = check_signals(u, y, valid)
        estimates = np.empty((len(u), len(self.names)))
        self._loop(self._tuning, self.state, u, y, present, estimates)
        return estimates
