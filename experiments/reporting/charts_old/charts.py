"""What a page can draw: charts of curves over a common axis, and what a click opens.

Plain values: `drawing` makes HTML of them for pages, `figures` draws them with matplotlib. Labels
are plain text; a symbol such as ``f_m`` in them is typeset there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from flexaxis.sim.errors import FlexaxisError

Array = NDArray[np.floating]
Kind = Literal["line", "steps", "points", "both"]
Role = Literal["estimate", "truth", "bound", "data"]


class ChartError(FlexaxisError):
    """A chart that cannot be drawn."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Line:
    """One curve in one panel.

    Attributes
    ----------
    who : str
        The estimator as typed: decides look, legend and hiding. Empty for truth, bounds, remarks.
    x, y : (M,) array
        In the units that the labels of chart and panel say; NaN is a gap.
    low, high : (M,) array, optional
        A band, or vertical whiskers for points.
    x_low, x_high : (M,) array, optional
        Horizontal whiskers, for points.
    kind : str
        ``"steps"`` keeps a value until the next; ``"both"`` is a line with its points.
    label : str
        What the legend says where `who` is not enough, such as ``"bound, all unknown"``.
    role : str
        Truth is dashed in the colour of text, a bound thin and dotted.
    pick : str
        What a click selects: the name of a `Pick` of the page, such as that of a seed.
    """

    x: Array
    y: Array
    who: str = ""
    low: Array | None = None
    high: Array | None = None
    kind: Kind = "line"
    label: str = ""
    role: Role = "estimate"
    x_low: Array | None = None
    x_high: Array | None = None
    pick: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class Panel:
    """One pair of axes; the panels of a chart stand below one another, over a common x.

    Attributes
    ----------
    y : str
        The label, with its unit.
    y_range : (float, float), optional
        What is shown at first; else what the lines cover, truth and medians before bands.
    whole : bool
        Whether all that there is has to be seen, bursts and bands as well.
    """

    y: str
    lines: Sequence[Line]
    title: str = ""
    y_log: bool = False
    y_range: tuple[float, float] | None = None
    whole: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Chart:
    """Panels over a common x.

    Attributes
    ----------
    title, words : str
        Above, and what there is to know of it below.
    x : str
        The label, with its unit.
    marks : sequence of (float, str)
        Vertical lines with what happens there, such as a fault.
    spans : sequence of (float, float, str)
        What is shaded, such as burn-in.
    windows : sequence of (str, float, float)
        Named ranges of x: the first and the last are shown, side by side where there is room.
    x_from : str
        Where x counts days: the date that is 0, as ISO 8601 has it; the axis then has dates.
    name : str
        Of its place in the page; by its title where empty. No two charts of a page have the same.
    """

    title: str
    words: str
    x: str
    panels: Sequence[Panel]
    marks: Sequence[tuple[float, str]] = ()
    spans: Sequence[tuple[float, float, str]] = ()
    windows: Sequence[tuple[str, float, float]] = ()
    x_log: bool = False
    x_from: str = ""
    name: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class Pick:
    """What the page shows after a click on a line of that name.

    Attributes
    ----------
    facts : sequence of (str, str)
        Terms and what they are here.
    command : str
        What repeats it, with a button to copy.
    charts : sequence of Chart
    """

    title: str
    words: str = ""
    facts: Sequence[tuple[str, str]] = ()
    command: str = ""
    charts: Sequence[Chart] = ()


def ends(rows: Sequence[Mapping[str, Any]], key: str, unit: float = 1.0) -> Any:
    """Return the ends (2, n) of the intervals beside a score; of what has none the score itself."""
    spans = [row.get(f"{key}_interval") or (row[key], row[key]) for row in rows]
    return np.array(spans, float).reshape(-1, 2).T / unit
