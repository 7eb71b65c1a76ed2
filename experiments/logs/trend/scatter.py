r"""How estimates from many logs scatter: by what each claims, and from log to log besides.

.. math:: \operatorname{cov} e = \operatorname{diag}(s^2) + \tau^2 \rho^{|t_i - t_j|/\Delta t}

with the claimed deviations s, a scatter τ of unknown size and its memory ρ from one log to the
next. Both are found by restricted likelihood (H. D. Patterson and R. Thompson, Biometrika 58,
1971).

The greatest of the ratios F of many changes has no closed distribution. It is simulated, for the
very times, covariates and deviations of a sequence. Chances that `DRAWS` sequences do not resolve
are those of their hundredth part, carried on as the tail of F with one degree of freedom, times the
growth of the number of places that count (J. Pickands, Transactions of the AMS 145, 1969): steps at
places nearby are as alike as values of a process of Ornstein and Uhlenbeck, and for that the number
grows as F does. Ramps are more alike, so that this errs to the safe side; all places together, with
the inequality of Bonferroni, are the most that it can come to.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.stats import f as fisher

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


LOOK, DRAWS = 500, 10_000  # simulated sequences: at a time, and at most
FEW = 5  # draws beyond, of which fewer do not tell how rare they are
KNOWN = 100  # draws from whose least the tail is carried on: known to 10 %


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


def chance_of(
    largest: float, design: Array, courses: Array, enough: float, rng: np.random.Generator
) -> float:
    """Return the probability that white noise has as large a ratio; roughly where it is likely.

    Parameters
    ----------
    largest : float
        The greatest ratio of a sequence.
    design, courses : ndarray (n, q), (n, m)
        White; as for `ratios`.
    enough : float
        Chance that is asked for; at greater ones the simulation stops early.
    rng : Generator
    """
    above, drawn, tops = 0, 0, np.empty(DRAWS)
    while drawn < DRAWS and above <= drawn * enough + 5 * np.sqrt(drawn * enough) + 1:
        ratio, _ = ratios(rng.standard_normal((len(design), LOOK)), design, courses)
        tops[drawn : drawn + LOOK] = ratio.max(axis=0)
        drawn += LOOK
        above = int((tops[:drawn] >= largest).sum())
    if drawn < DRAWS or DRAWS * enough >= FEW:
        return (above + 1) / (drawn + 1)
    return beyond(largest, tops, len(design) - design.shape[1] - 1, courses.shape[1])


def beyond(largest: float, tops: Array, freedom: int, places: int) -> float:
    """Return the chance of a great ratio from simulated greatest ones, however small it is.

    Parameters
    ----------
    largest : float
    tops : ndarray (S,)
        Greatest ratios of S sequences of noise.
    freedom : int
        Degrees of freedom of the denominator of F.
    places : int
        How many ratios each is the greatest of.
    """
    known = float(np.sort(tops)[-KNOWN])
    if largest <= known:
        return float((tops >= largest).mean())
    tail, there = fisher.logsf([largest, known], 1, freedom)
    carried = np.log(KNOWN / len(tops)) + tail - there + np.log(largest / known)
    return float(np.exp(min(carried, np.log(places) + tail)))
