"""What charts are drawn of: curves as paths of SVG, thinned."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.reporting.charts_old.charts import Line
from flexaxis.experiments.reporting.charts_old.scales import Scale

Array = NDArray[np.float64]

UNITS = 10_000  # across and up, of the inner picture
COLUMNS = 500  # of a view, of which least and greatest are drawn
SLACK = 30  # units by which a drawn line may pass a point: half a pixel


def units(shares: Array) -> list[int]:
    """Return shares of a panel in units of the inner picture."""
    return np.rint(UNITS * np.clip(np.nan_to_num(shares), -9, 10)).astype(int).tolist()  # type: ignore[no-any-return]


def places(line: Line, side: NDArray[Any], x: Scale, y: Scale) -> tuple[Array, Array]:
    """Return a curve in units of the inner picture, as far as it is in the view; NaN is a gap."""
    a, b = UNITS * x.share(line.x), UNITS * (1 - y.share(side))
    before, after = np.r_[a[:1], a[:-1]], np.r_[a[1:], a[-1:]]
    with np.errstate(invalid="ignore"):
        kept = (np.fmax(np.fmax(before, a), after) >= 0) & (
            np.fmin(np.fmin(before, a), after) <= UNITS
        )
    return a[kept], np.clip(np.where(np.isfinite(b), b, np.nan), -9 * UNITS, 10 * UNITS)[kept]


def runs(a: Array, *sides: Array) -> Iterator[slice]:
    """Yield the parts of a curve in which all of it is there."""
    there = np.isfinite(a) & np.all([np.isfinite(side) for side in sides], axis=0)
    edges = np.flatnonzero(np.diff(np.r_[0, there, 0]))
    yield from (slice(i, j) for i, j in zip(edges[::2], edges[1::2], strict=True))


def path(a: Array, b: Array, *, steps: bool = False) -> str:
    """Return a path through points: of steps each value until the next."""
    if steps:
        a, b = np.repeat(a, 2)[1:], np.repeat(b, 2)[:-1]
    elif len(a) > 1:
        forward = slice(None, None, 1 if a[-1] >= a[0] else -1)
        kept = extremes(a[forward], b[forward])
        a, b = a[forward][kept][forward], b[forward][kept][forward]
        kept_ = _needed(a.tolist(), b.tolist())
        a, b = a[kept_], b[kept_]
    points = np.rint(np.stack([a, b], axis=1)).astype(int)
    ways = "l".join(f"{da},{db}" for da, db in np.diff(points, axis=0).tolist())
    return f"M{points[0, 0]},{points[0, 1]}" + (f"l{ways}" if ways else "h0")


def _needed(xs: Sequence[float], ys: Sequence[float]) -> list[int]:
    """Return which points a curve needs so that it passes all others by SLACK at most.

    From the last that is kept, the slopes that do so are a wedge; a point outside of it ends it.
    """
    kept, least, most, i = [0], -np.inf, np.inf, 1
    while i < len(xs):
        wide, rise = abs(xs[i] - xs[kept[-1]]), ys[i] - ys[kept[-1]]
        if wide and least * wide <= rise <= most * wide:
            least, most = max(least, (rise - SLACK) / wide), min(most, (rise + SLACK) / wide)
            i += 1
        elif kept[-1] == i - 1:  # nothing lies between: a jump
            kept.append(i)
            least, most, i = -np.inf, np.inf, i + 1
        else:
            kept.append(i - 1)
            least, most = -np.inf, np.inf
    return kept if kept[-1] == len(xs) - 1 else [*kept, len(xs) - 1]


def extremes(x: ArrayLike, *sides: ArrayLike, columns: int = COLUMNS) -> NDArray[np.int64]:
    """Return the places of a curve that a screen needs: no spike is lost, and no gap.

    Parameters
    ----------
    x : (N,) array_like
        Not falling.
    *sides : (N,) array_like
        The curve; of a band its sides too. NaN is a gap.
    columns : int
        Of how many the screen is; a shorter curve is kept whole.

    Examples
    --------
    >>> y = [0.0, 1.0, 9.0, 1.0, 0.0, -5.0, 0.0, 0.0]
    >>> extremes(range(8), y, columns=2).tolist()
    [0, 2, 5, 7]
    """
    place = np.asarray(x, float)
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
