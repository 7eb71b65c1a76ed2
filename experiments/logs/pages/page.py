"""What pages of logs are made of: curves, panels that show all of them, and the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.files import write_text
from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.reporting.charts_old.charts import Chart, Line, Panel
from flexaxis.experiments.reporting.charts_old.page import render
from flexaxis.experiments.reporting.charts_old.tables import Table

Array = NDArray[np.float64]

LOG = "log"  # what a line of the log is called, on every page of one
BINS, FEW = 60, 5  # of means, and samples that one holds at the least
GAPS = 200  # that are shaded: more are a pattern, and seen as one


def panel(y: str, *lines: Line, y_log: bool = False) -> Panel:
    """Return a panel that shows all there is: what sticks out of a log is what one looks for."""
    return Panel(y=y, lines=lines, y_log=y_log, whole=True)


def line(x: ArrayLike, y: ArrayLike, who: str = LOG, **more: Any) -> Line:
    """Return a curve, or points."""
    return Line(who=who, x=np.asarray(x, float), y=np.asarray(y, float), **more)


def means(x: Array, y: Array, who: str = LOG, *, band: bool = True) -> Line:
    """Return means of y in `BINS` bins of x that hold as much each, with 10 … 90 % of it."""
    held = [k for k in np.array_split(np.argsort(x, kind="stable"), BINS) if len(k) > FEW]
    across, mean = (np.array([values[k].mean() for k in held]) for values in (x, y))
    if not band:
        return Line(who=who, x=across, y=mean)
    low, high = np.array([np.percentile(y[k], (10, 90)) for k in held]).reshape(-1, 2).T
    return Line(who=who, kind="points", x=across, y=mean, low=low, high=high)


def compared(
    time: Array, y: Array, sides: Mapping[str, Array], piece: slice, label: str = "speed [rad/s]"
) -> list[Panel]:
    """Return panels of a measured piece with others over it, and of how far they are off."""
    t, log = time[piece], Line(x=time[piece], y=y[piece], role="truth", label="log")
    unit = label[label.index("[") :]
    return [
        panel(label, log, *(line(t, x[piece], who) for who, x in sides.items())),
        panel(f"error {unit}", *(line(t, (y - x)[piece], who) for who, x in sides.items())),
    ]


def gaps(time: ArrayLike, ok: NDArray[np.bool_]) -> list[tuple[float, float, str]]:
    """Return what is to be shaded: where samples do not count."""
    t, edges = np.asarray(time, float), np.flatnonzero(np.diff(np.r_[1, ok, 1]))
    pairs = list(zip(edges[::2], edges[1::2], strict=True))[:GAPS]
    return [(float(t[begin]), float(t[end - 1]), "") for begin, end in pairs]


@dataclass(frozen=True)
class LogPage:
    """What a page shows.

    Attributes
    ----------
    title, command : str
    finding : Finding
        What comes of it, in one sentence.
    remarks : sequence of Finding
        What there is to say besides.
    charts : sequence of Chart
        The first one stands with the finding, the others behind the tables.
    tables : sequence of Table
    """

    title: str
    command: str
    finding: Finding
    remarks: Sequence[Finding]
    charts: Sequence[Chart]
    tables: Sequence[Table]


def write_page(page: LogPage, path: Path) -> None:
    """Write a page as one HTML file that needs no network."""
    content = vars(page) | {"version": version("flexaxis")}
    write_text(path, render("logs/templates/log.html", content))


def capital(text: str) -> str:
    """Return a text as a sentence; a symbol such as f_c at its beginning stays as it is.

    Examples
    --------
    >>> capital("no parameter changed"), capital("f_c has grown")
    ('No parameter changed.', 'f_c has grown.')
    """
    first, *_ = text.split(" ", 1)
    return (text[:1].upper() + text[1:] if first.isalpha() else text).rstrip(".") + "."
