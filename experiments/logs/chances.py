"""How likely noise alone has a likelihood ratio as great: simulated, and beyond that extrapolated.

The greatest of the ratios F of many changes has no closed distribution. It is simulated, for the
very times, covariates and deviations of a sequence. Chances that `DRAWS` sequences do not resolve
are those of their hundredth part, carried on as the tail of F with one degree of freedom, times the
growth of the number of places that count (J. Pickands, Transactions of the AMS 145, 1969): steps at
places nearby are as alike as values of a process of Ornstein and Uhlenbeck, and for that the number
grows as F does. Ramps are more alike, so that this errs to the safe side; all places together, with
the inequality of Bonferroni, are the most that it can come to.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

Array = NDArray[np.float64]

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
