"""What was seen of a doubt, as a chart: the log, and what is remarkable in it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexaxis.experiments.reporting.charts import Chart, Line, Panel
from flexaxis.experiments.reporting.thinning import extremes

LOG = "log"  # what a line of the log is called, on every page of one


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
    return Chart(title="", words="", x=x, panels=[Panel(y=y, lines=lines, y_log=y_log)], **more)


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
