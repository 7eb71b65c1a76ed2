"""A control: the paper's method, told when the parameters change."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.methods.rpem import Rpem
from flexaxis.estimators.signals import check_sample, check_signals

Array = NDArray[np.float64]


class OracleReset:
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
    noise : float
        Standard deviation of the output [rad/s].

    Attributes
    ----------
    names, output, bounds, theta, covariance
        Those of the filter.
    """

    def __init__(
        self, rpem: Rpem, *, onsets: Sequence[int], spread: float = 0.5, noise: float = 0.1
    ) -> None:
        self._rpem, self._onsets = rpem, sorted(onsets)
        self._spread, self._noise = spread, noise
        self.names, self.output, self.bounds = rpem.names, rpem.output, rpem.bounds
        self._count = 0

    def reset(self) -> None:
        """Return to the start."""
        self._rpem.reset()
        self._count = 0

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._rpem.theta

    @property
    def covariance(self) -> Array:  # noqa: D102
        return self._rpem.covariance

    def step(self, u: float, y: float | None) -> Array:
        """Take u[k] and y[k] (None in a gap) and return θ[k] (p,)."""
        check_sample(u, y)
        return self.run([u], [0.0 if y is None else y], [y is not None])[0]

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
        first = self._count
        inside = [onset - first for onset in self._onsets if first <= onset < first + len(u)]
        estimates = []
        for start, stop in zip([0, *inside], [*inside, len(u)], strict=True):
            if start in inside:
                # y[onset] is still that of the old parameters; what is held from here on is not
                self._rpem.restart((self._spread * self._rpem.theta / self._noise) ** 2)
            part = slice(start, stop)
            estimates.append(self._rpem.run(u[part], y[part], present[part]))
        self._count += len(u)
        return np.concatenate(estimates)
