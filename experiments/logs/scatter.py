r"""How estimates from many logs scatter: by what each claims, and from log to log besides.

.. math:: \operatorname{cov} e = \operatorname{diag}(s^2) + \tau^2 \rho^{|t_i - t_j|/\Delta t}

with the claimed deviations s, a scatter τ of unknown size and its memory ρ from one log to the
next. Both are found by restricted likelihood (H. D. Patterson and R. Thompson, Biometrika 58,
1971).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

Array = NDArray[np.float64]

CORRELATIONS = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75)
SCATTERS = np.geomspace(0.1, 30.0, 20)  # τ over the median deviation
LONG = 300  # logs, of which every other of these is tried
LEAN = 0.25
"""Log-likelihood that may be lost for more memory, since the estimate of it is too low."""


class Scatter:
    """The covariance of a sequence, in units of the median claimed deviation.

    Parameters
    ----------
    time : ndarray (n,)
    deviation : ndarray (n,)
        Claimed, in that unit.

    Attributes
    ----------
    size, memory : float
        τ and ρ; zero before `fit`.
    """

    def __init__(self, time: Array, deviation: Array) -> None:
        step = float(np.median(np.diff(time))) or 1.0
        self._lags = abs(time[:, None] - time[None, :]) / step
        self._variance = deviation**2
        self.size, self.memory = 0.0, 0.0
        self._root = np.diag(deviation)

    def white(self, values: Array) -> Array:
        """Return values (n, …) in coordinates in which the noise is white."""
        return solve_triangular(self._root, values, lower=True, check_finite=False)

    def fit(self, x: Array, design: Array) -> None:
        """Choose τ and ρ for a sequence x (n,) that is a sum of columns (n, q) and noise."""
        entries = list(self._likelihoods(x, design))
        likeliest = max(entries, key=lambda entry: entry[0])
        near = [e[2] for e in entries if e[0] >= likeliest[0] - LEAN]
        memory = max(near) if likeliest[1] else 0.0
        same = [e for e in entries if e[2] == memory]
        _, self.size, self.memory, self._root = max(same, key=lambda entry: entry[0])

    def _likelihoods(self, x: Array, design: Array) -> Iterator[tuple[float, float, float, Array]]:
        every = 2 if len(x) > LONG else 1
        for memory in CORRELATIONS[::every]:
            alike = memory**self._lags if memory else np.eye(len(x))
            for size in (() if memory else (0.0,)) + tuple(SCATTERS[::every].tolist()):
                covariance = size**2 * alike + np.diag(self._variance)
                root = cholesky(covariance, lower=True, check_finite=False)
                yield _restricted(x, design, root), size, memory, root


def _restricted(x: Array, design: Array, root: Array) -> float:
    """Return the restricted log-likelihood, but for a constant."""
    Z = solve_triangular(root, design, lower=True, check_finite=False)
    r = solve_triangular(root, x, lower=True, check_finite=False)
    Q, R = np.linalg.qr(Z)
    r = r - Q @ (Q.T @ r)
    sizes = np.concatenate([np.diag(root), np.maximum(abs(np.diag(R)), 1e-12)])
    return float(-np.log(sizes).sum() - r @ r / 2)
