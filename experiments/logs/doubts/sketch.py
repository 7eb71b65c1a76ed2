"""What was seen of a doubt, as a chart: the log, and what is remarkable in it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexaxis.experiments.reporting.charts import Chart, Line, Panel
from flexaxis.experiments.reporting.thinning import extremes

LOG = "log"  # what a line of the log is called, on every page of one
ROOM = 0.05  # above and below what is drawn


def sketch(x: str, y: str, *lines: Line, y_log: bool = False, **more: Any) -> Chart:
    """Return a chart without title and words, which whoever shows it has.

    Parameters
    ----------
    x, y : str
        Labels, with units.
    *lines : Line
    y_log : bool
    **more
        Of the `Chart`: its marks, and whether x is logarithmic.
    """
    return Chart(title="", words="", x=x, panels=[panel(y, *lines, y_log=y_log)], **more)


def panel(y: str, *lines: Line, y_log: bool = False) -> Panel:
    """Return a panel that shows all there is: what sticks out of a log is what one looks for."""
    sides = [s for each in lines for s in (each.y, each.low, each.high) if s is not None]
    values = np.concatenate([np.zeros(0), *sides])
    values = values[np.isfinite(values) & ((values > 0) | (not y_log))]
    if not values.size or values.min() == values.max():
        return Panel(y=y, lines=lines, y_log=y_log)
    low, high = float(values.min()), float(values.max())
    if y_log:
        return Panel(y=y, lines=lines, y_log=True, y_range=(low / 1.1, high * 1.1))
    room = ROOM * (high - low)
    return Panel(y=y, lines=lines, y_range=(low - room, high + room))


def line(x: ArrayLike, y: ArrayLike, who: str = LOG, *, log: bool = False, **more: Any) -> Line:
    """Return a curve, thinned to what a screen shows; `log` where its x is drawn so."""
    across, up = np.asarray(x, float), np.asarray(y, float)
    kept = extremes(across, up, log=log)
    return Line(who=who, x=across[kept], y=up[kept], **more)


def points(x: ArrayLike, y: ArrayLike, who: str) -> Line:
    """Return points."""
    return Line(who=who, x=np.asarray(x, float), y=np.asarray(y, float), kind="points")


def histogram(values: ArrayLike, bins: int) -> Line:
    """Return how many values lie between evenly spaced edges, as steps."""
    counts, edges = np.histogram(np.asarray(values, float), bins)
    return Line(who=LOG, x=edges, y=np.append(counts, 0.0), kind="steps")
