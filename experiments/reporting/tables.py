"""Tables of a page: heads with units, cells with values to sort by; `table.html` writes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal


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
    more : bool
        Whether it is shown on demand.
    """

    heading: str
    term: str = ""
    kind: Literal["number", "text", "command"] = "number"
    more: bool = False


@dataclass(frozen=True)
class Cell:
    """What stands in a cell.

    Attributes
    ----------
    text : str
    value : float or str, optional
        What it is sorted by and saved as; the text where it is None.
    within : str
        An interval, in small letters behind.
    """

    text: str
    value: float | str | None = None
    within: str = ""


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
    """

    heading: str
    columns: Sequence[Column]
    rows: Sequence[Row]
    words: str = ""


def texts(heading: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a table of words."""
    lines = [Row([Cell(text) for text in row]) for row in rows]
    return Table(heading, [Column(head, kind="text") for head in heads], lines)
