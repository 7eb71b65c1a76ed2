"""From which sample on a run is lost, and the box, the same for all, at whose edges it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AT_BOUND = 1.0  # s at a bound that make a run diverged
BOX = (0.1, 10.0)  # over nominal: where an estimate has to stay, by which everybody is judged
EDGE = 1e-6  # of nominal: nearer to the edge of the box is on it


def box(nominal: Array, truth: Array) -> tuple[Array, Array]:
    """Return the edges, each (p,), that no estimate may sit on: .1 and 10 × nominal.

    The same for every estimator, whatever bounds of its own it has. Where the truth itself (N, p)
    leaves the box, it is widened by as much again, so that the truth lies well inside.
    """
    lower, upper = np.sort(np.outer(BOX, nominal), axis=0)
    low, high, room = truth.min(axis=0), truth.max(axis=0), abs(nominal)
    lower = np.where(low <= lower, low - room, lower)
    return lower, np.where(high >= upper, high + room * BOX[1], upper)


def loss(theta: Array, edges: tuple[Array, Array], period: float) -> int | None:
    """Return the first sample (of N) from which a run (N, p) is lost, or None.

    Lost is an estimate that is not finite, or that stays at or beyond an edge of the box for more
    than 1 s; then it is lost from the first of these samples on.
    """
    lower, upper = edges
    room = EDGE * np.minimum(abs(lower), abs(upper))
    with np.errstate(invalid="ignore"):
        outside = (theta <= lower + room) | (theta >= upper - room)
    bad = np.flatnonzero(~np.isfinite(theta).all(axis=1))
    found = [int(bad[0])] if bad.size else []
    longest = round(AT_BOUND / period)
    if len(theta) > longest:
        count = np.cumsum(np.vstack([np.zeros((1, theta.shape[1]), int), outside]), axis=0)
        stretches = (count[longest + 1 :] - count[: -longest - 1] == longest + 1).any(axis=1)
        found += np.flatnonzero(stretches)[:1].tolist()
    return min(found, default=None)
