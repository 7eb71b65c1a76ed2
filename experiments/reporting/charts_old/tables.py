"""Tables: heads with units, cells with values to sort by, how values are written, what words mean.

`table.html` writes them into a page, `terminal` on a screen. Scores are defined in
`flexaxis.experiments.scoring.score_table` and nowhere else.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from markupsafe import Markup, escape

from flexaxis.experiments.scoring.score_table import SCORES

# A letter with an index that is no part of a longer word; as in assets/dom.js.
SYMBOL = re.compile(r"(?<![\w-])([A-Za-zΔθσψεμλτ])_([A-Za-z0-9θ]{1,3})(?![A-Za-z0-9_-])")
_CODE = re.compile(r"`([^`]+)`")
_SUNK = '<tspan font-style="italic">{}</tspan><tspan class="sub" dy="0.28em">{}</tspan>'
_RISEN = '<tspan dy="-0.21em">{}</tspan>'


@dataclass(frozen=True)
class Column:
    """The head of a column.

    Attributes
    ----------
    heading : str
        With the unit.
    term : str
        The word of the glossary for it, if there is one.
    kind : {"number", "text", "command"}
        Numbers stand to the right; a command is in the letters of a terminal.
    more : bool or "again"
        Whether it is shown on demand; ``"again"`` is left out on paper, for it is said elsewhere.
    under : str
        In small letters below the heading.
    name : str
        What it is called in a file, where the heading alone would not do.
    link : str
        The name of the place on the page that it leads to.
    who : str
        The estimator that it is of: with it the column is hidden.
    down : bool
        Whether what is large is better, and comes first.
    """

    heading: str
    term: str = ""
    kind: Literal["number", "text", "command"] = "number"
    more: bool | Literal["again"] = False
    under: str = ""
    name: str = ""
    link: str = ""
    who: str = ""
    down: bool = False


@dataclass(frozen=True)
class Cell:
    """What stands in a cell.

    Attributes
    ----------
    text : str
    value : float or str, optional
        What it is sorted by and saved as; the text where it is None, and nothing where it is "".
    within : str
        An interval or a remark, in small letters behind; a new line where there is one.
    ends : pair of float or None, optional
        The interval, to be saved.
    mark : str
        A sign before the text, saved beside the value.
    link, opens : str
        The place on the page that it leads to; the `Pick` that it opens.
    who : str
        The estimator that it is of: with it the cell is hidden.
    tone : float, optional
        Where its value lies on the page's scale of colours, 0 to 1, so that the table is a map too.
    """

    text: str
    value: float | str | None = None
    within: str = ""
    ends: Sequence[float | None] | None = None
    mark: str = ""
    link: str = ""
    opens: str = ""
    who: str = ""
    tone: float | None = None


@dataclass(frozen=True)
class Row:
    """A line of a table.

    Attributes
    ----------
    cells : sequence of Cell
    who : str
        The estimator that it is of: with it the row is hidden.
    kind : str
        A class of the style sheet: ``"changed"``, ``"lost"``, or a verdict.
    group : str
        The group that it belongs to, where the page can be filtered by one.
    """

    cells: Sequence[Cell]
    who: str = ""
    kind: str = ""
    group: str = ""


@dataclass(frozen=True)
class Table:
    """A table under a heading.

    Attributes
    ----------
    heading : str
    columns : sequence of Column
    rows : sequence of Row
    words : str
        What there is to know of it, below.
    folded : str
        What it is called where it is folded away; empty for one that is not.
    """

    heading: str
    columns: Sequence[Column]
    rows: Sequence[Row]
    words: str = ""
    folded: str = ""


def scored(value: float | None, *, within: str = "", digits: int = 3) -> Cell:
    """Return a cell with a number, to be sorted by all of its digits."""
    return Cell(number(value, digits), "" if value is None else value, within)


def toned(values: Sequence[float | None]) -> list[Cell]:
    """Return cells of numbers on one scale of colours, of their logarithms."""
    scale = [None if v is None or v <= 0 else np.log(v) for v in values]
    known = [v for v in scale if v is not None] or [0.0]
    low, over = min(known), (max(known) - min(known)) or 1.0
    tones = [None if v is None else float((v - low) / over) for v in scale]
    return [replace(scored(v), tone=tone) for v, tone in zip(values, tones, strict=True)]


def tone_style(tone: float) -> str:
    """Return the style of a cell of a tone; the colours read the same to the colour-blind."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    letters = "#000" if tone > 0.47 else "#fff"  # from there on black is easier to read
    return f"background:{to_hex(colormaps['cividis'](tone))};color:{letters}"


def texts(heading: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a table of words."""
    lines = [Row([Cell(text) for text in row]) for row in rows]
    return Table(heading, [Column(head, kind="text") for head in heads], lines)


def number(value: float | None, digits: int = 3) -> str:
    """Return a number for a table; what is not defined is a dash.

    Examples
    --------
    >>> number(1234.0), number(-1234.0), number(0.01234), number(None)
    ('1234', '-1234', '0.0123', '–')
    """
    if value is None:
        return "–"
    # 120 and not 1.2e+02
    return f"{value:.0f}" if 10**digits <= abs(value) < 1e5 else f"{value:.{digits}g}"


def pair(interval: Sequence[float | None] | None) -> str:
    """Return an interval for a table; an end that is not finite is said in words."""
    if interval is None:
        return ""
    return " … ".join("never" if end is None else f"{end:.3g}" for end in interval)


def settled(value: float | None, changed: bool) -> str:
    """Return a settling time for a table; never is said in words."""
    return number(value) if value is not None or not changed else "never"


def symbols(text: str) -> Markup:
    """Return text with its symbols as letter and index, such as f_m, 1/J_a, and `code` as such.

    Examples
    --------
    >>> symbols("1/J_a < pause_fm")
    Markup('1/<i>J</i><sub>a</sub> &lt; pause_fm')
    """
    typeset = SYMBOL.sub(r"<i>\1</i><sub>\2</sub>", str(escape(text)))
    return Markup(_CODE.sub(r"<code>\1</code>", typeset))


def in_svg(text: str) -> Markup:
    """Return text for SVG with its symbols as letter and index.

    Examples
    --------
    >>> in_svg("lag [s]")
    Markup('lag [s]')
    """
    before, *parts = SYMBOL.split(text)
    found = [escape(before)]
    for letter, index, after in zip(parts[::3], parts[1::3], parts[2::3], strict=True):
        found.append(Markup(_SUNK).format(letter, index))
        found.append(Markup(_RISEN).format(after) if after else Markup())
    return Markup().join(found)


TERMS = {score.heading: score.words for score in SCORES.values() if score.heading} | {
    "bound": "The Cramér–Rao bound for whoever is told when the fault happens, and takes all "
    "estimated parameters for unknown after it, with a wide prior: the mean size √(2/π)σ of a "
    "Gaussian error on it. Not what no estimator can beat: who finds out that only one parameter "
    "changed has a smaller one.",
    "× bound": "Geometric mean of the lag over the mean lag of the bound, computed from the "
    "torque of each record; who finds out that only one parameter has changed can "
    "be below 1.",
    "at equal noise": "Each estimator is run at several settings of its knob, and its lag "
    "interpolated between the two on either side of the noise of the reference; at exactly that "
    "noise it is not run.",
    "knob": "The one option of an estimator that buys speed with noise, such as the forgetting "
    "factor λ.",
    "forgetting factor": "λ: the weight of a sample falls by this factor with each new one, so "
    "that the last 1/(1−λ) samples count.",
    "false alarms": "Changes that the estimator says it found where nothing had changed, in 1000 s "
    "of motion.",
    "error over bound": "Root mean square error 200 samples after the fault (1 s at 5 ms) over the "
    "bound with all parameters unknown; below 1 knows more, for example that only one has changed.",
    "detection": "How often, and how soon after a fault, an estimator says that something changed.",
    "burn-in": "The time at the beginning in which estimators settle; no score counts it.",
    "seed": "What the random parts of a run are drawn from: the same seed is the same run.",
    "interval": "95 % interval over the seeds: Student’s t, for means with Hall’s correction for "
    "skewness, on the jackknife’s values where lags are interpolated to equal noise; of medians by "
    "order statistics. There is none with fewer than five seeds.",
    "tie": "Marked ★: the best, and all that pairs on common seeds cannot tell from it at 5 %.",
    "nominal": "The parameters of the axis as designed, on which θ is given: 1 is nominal.",
    "scenario": "An axis, its excitation and what happens to it, frozen under a name.",
    "fault": "A change of a physical parameter at a known time.",
    "control": "An estimator that bounds the field and takes no part: doing nothing, or told all.",
    "ECDF": "Share of all runs whose lag is at most so many times the bound: higher and more to "
    "the left is better.",
}
"""What words of the pages mean: shown by hover and by keyboard wherever `term` marks one."""
