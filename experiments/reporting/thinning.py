"""Long curves thinned to what a screen shows: lowest and highest of each column of pixels stay."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

COLUMNS = 1200  # of a wide screen


def extremes(
    x: ArrayLike, *sides: ArrayLike, columns: int = COLUMNS, log: bool = False
) -> NDArray[np.int64]:
    """Return the places of a curve that a screen needs: no spike is lost, and no gap.

    Parameters
    ----------
    x : (N,) array_like
        Not falling; of `log` above 0.
    *sides : (N,) array_like
        The curve; of a band its sides too. NaN is a gap.
    columns : int
        Of how many the screen is; a shorter curve is kept whole.
    log : bool
        Whether columns are of equal ratio.

    Examples
    --------
    >>> y = [0.0, 1.0, 9.0, 1.0, 0.0, -5.0, 0.0, 0.0]
    >>> extremes(range(8), y, columns=2).tolist()
    [0, 2, 5, 7]
    """
    place = np.log(np.asarray(x, float)) if log else np.asarray(x, float)
    if len(place) <= 2 * columns:
        return np.arange(len(place))
    wide = (place[-1] - place[0]) / columns or 1.0
    column = np.minimum((place - place[0]) / wide, columns - 1).astype(np.int64)
    kept = [np.array([0, len(place) - 1])]
    kept += [_of_side(column, np.asarray(side, float)) for side in sides]
    return np.unique(np.concatenate(kept))


def _of_side(column: NDArray[np.int64], side: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the places of least, greatest and a missing value in each column."""
    order = np.lexsort((side, column))  # NaN last in its column
    first = np.flatnonzero(np.diff(column[order], prepend=-1))
    there = np.bincount(column[np.isfinite(side)], minlength=column[-1] + 1)[column[order[first]]]
    missing = order[(first + there)[first + there < np.append(first[1:], len(order))]]
    full = there > 0
    return np.concatenate([order[first[full]], order[(first + there - 1)[full]], missing])
