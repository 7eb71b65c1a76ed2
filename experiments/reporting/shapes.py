"""What charts are drawn of: curves as paths of SVG, thinned, and maps as tables of cells."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from markupsafe import escape
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.reporting.charts import Heat, Line
from flexaxis.experiments.reporting.scales import Scale
from flexaxis.experiments.reporting.tables import symbols

Array = NDArray[np.float64]

UNITS = 10_000  # across and up, of the inner picture
COLUMNS = 500  # of a view, of which least and greatest are drawn
WIDE = 1200  # columns of a wide screen
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
        kept = extremes(a[forward], b[forward], columns=COLUMNS)
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


def extremes(
    x: ArrayLike, *sides: ArrayLike, columns: int = WIDE, log: bool = False
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


def maps(heat: Heat) -> Iterator[str]:
    """Yield each map as a table with coloured cells."""
    scale = _tones(heat)
    heads = "".join(f'<th scope="col">{symbols(_name(x))}</th>' for x in heat.xs)
    for cells in heat.panels:
        rows = list(zip(heat.ys, np.asarray(cells.values), strict=True))[::-1]
        body = "".join(
            f'<tr><th scope="row">{symbols(_name(y))}</th>'
            f"{''.join(_cell(float(v), scale, heat.unit) for v in row)}</tr>"
            for y, row in rows
        )
        yield (
            f'<div class="view heat" data-who="{escape(cells.who)}" tabindex="0">'
            '<table class="heat">'
            f"<caption>{escape(cells.title or cells.who)}</caption><tbody>{body}</tbody><tfoot><tr>"
            f"<th>{symbols(f'{heat.y} ↑, {heat.x} →')}</th>{heads}</tr></tfoot></table></div>"
        )


def _name(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:.3g}"


def _tones(heat: Heat) -> Scale:
    values = np.concatenate([np.ravel(cells.values) for cells in heat.panels] or [np.empty(0)])
    known = values[np.isfinite(values) & ((values > 0) | (not heat.log))]
    ends = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    return Scale(*ends, heat.log and known.size > 0)


def _cell(value: float, scale: Scale, unit: str) -> str:
    if not np.isfinite(value):
        return "<td></td>"
    share = float(np.clip(scale.share(value), 0, 1))
    return (
        f'<td class="{"dark" if share > 0.47 else "light"}" style="background:{_colour(share)}" '
        f'data-value="{value:.6g}" title="{value:.4g} {escape(unit)}">{value:.2g}</td>'
    )


def _colour(share: float) -> str:
    """Return the colour of a share; it reads the same to the colour-blind."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return to_hex(colormaps["cividis"](share))


def heat_legend(heat: Heat) -> str:
    """Return the scale of colours, with its ends."""
    scale, shades = _tones(heat), ", ".join(_colour(i / 8) for i in range(9))
    bar = f'<i class="shades" style="background:linear-gradient(90deg, {shades})"></i>'
    ends = f"{scale.low:.3g}", f"{scale.high:.3g}"
    unit = escape(heat.unit)
    return f'<span class="role">{ends[0]} {bar} {ends[1]} {unit}</span>'
