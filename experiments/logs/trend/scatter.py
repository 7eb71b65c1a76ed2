r"""How estimates from many logs scatter: by what each claims, and from log to log besides.

.. math:: \operatorname{cov} e = \operatorname{diag}(s^2) + \tau^2 \rho^{|t_i - t_j|/\Delta t}

with the claimed deviations s, a scatter τ of unknown size and its memory ρ from one log to the
next. Both are found by restricted likelihood (H. D. Patterson and R. Thompson, Biometrika 58,
1971).

The greatest of the ratios F of many changes has no closed distribution. It is simulated, for the
very times, covariates and deviations of a sequence; a chance that the draws do not resolve is at
most that of one ratio times the number of places, by the inequality of Bonferroni.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.stats import f as fisher

Array = NDArray[np.float64]

CORRELATIONS = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75)
SCATTERS = tuple(np.geomspace(0.1, 30.0, 20).tolist())  # τ over the median deviation
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
        every, tried = 2 if len(x) > LONG else 1, []
        for memory in CORRELATIONS[::every]:
            alike = memory**self._lags if memory else np.eye(len(x))
            for size in (() if memory else (0.0,)) + SCATTERS[::every]:
                covariance = size**2 * alike + np.diag(self._variance)
                root = cholesky(covariance, lower=True, check_finite=False)
                tried.append((_restricted(x, design, root), size, memory, root))
        likeliest = max(tried, key=lambda each: each[0])
        near = [each[2] for each in tried if each[0] >= likeliest[0] - LEAN]
        memory = max(near) if likeliest[1] else 0.0
        same = (each for each in tried if each[2] == memory)
        _, self.size, self.memory, self._root = max(same, key=lambda each: each[0])


def _restricted(x: Array, design: Array, root: Array) -> float:
    """Return the restricted log-likelihood, but for a constant."""
    Z = solve_triangular(root, design, lower=True, check_finite=False)
    r = solve_triangular(root, x, lower=True, check_finite=False)
    Q, R = np.linalg.qr(Z)
    r = r - Q @ (Q.T @ r)
    sizes = np.concatenate([np.diag(root), np.maximum(abs(np.diag(R)), 1e-12)])
    return float(-np.log(sizes).sum() - r @ r / 2)


LOOK, DRAWS = 500, 10_000  # simulated sequences: at a time, and at most
ENOUGH = 100  # draws beyond: they tell a chance to 10 %


def ratios(x: Array, design: Array, courses: Array) -> tuple[Array, Array]:
    """Return F (m, S) of each of m courses in each of S white sequences, and what each explains.

    Parameters
    ----------
    x : ndarray (n,) or (n, S)
    design : ndarray (n, q)
        What explains the sequences already.
    courses : ndarray (n, m)
    """
    Q, _ = np.linalg.qr(design)
    left = courses - Q @ (Q.T @ courses)
    length = np.linalg.norm(left, axis=0)
    # what the design explains already is no change of its own
    there = length > 1e-3 * np.linalg.norm(courses, axis=0)
    unit = np.where(there, left / np.where(there, length, 1.0), 0.0)
    residual = x - Q @ (Q.T @ x)
    gain = (unit.T @ residual) ** 2
    freedom = len(x) - design.shape[1] - 1
    total = (residual**2).sum(axis=0)
    return gain * freedom / np.maximum(total - gain, 1e-300), gain


def chance_of(largest: float, design: Array, courses: Array, rng: np.random.Generator) -> float:
    """Return the probability that white noise has as large a ratio.

    Parameters
    ----------
    largest : float
        The greatest ratio of a sequence.
    design, courses : ndarray (n, q), (n, m)
        White; as for `ratios`.
    rng : Generator
    """
    above = drawn = 0
    while drawn < DRAWS and above < ENOUGH:
        ratio, _ = ratios(rng.standard_normal((len(design), LOOK)), design, courses)
        above, drawn = above + int((ratio.max(axis=0) >= largest).sum()), drawn + LOOK
    one = float(fisher.sf(largest, 1, len(design) - design.shape[1] - 1))
    return min((above + 1) / (drawn + 1), courses.shape[1] * one)
