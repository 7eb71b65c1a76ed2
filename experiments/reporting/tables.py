"""Tables: how numbers are written, cells to sort by, and the cells of pooled scores.

A template writes a `Table` into a page. Scores are defined in
`flexaxis.experiments.scoring.score_table` and nowhere else.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexaxis.experiments.scoring.score_table import SCORES

SYMBOL = re.compile(r"(?<![\w-])([A-Za-zΔθσψεμλτ])_([A-Za-z0-9θ]{1,3})(?![A-Za-z0-9_-])")
"""A letter with an index, such as f_m, that is no part of a longer word."""
Row = Mapping[str, Any]


@dataclass(frozen=True)
class Cell:
    """A cell of a table.

    Attributes
    ----------
    text : str
    value : float or str, optional
        What the cell is sorted by and saved as; its text by default.
    small : str
        An interval or a remark, in small letters below.
    best : bool
        Whether the cell is marked as the best, or not distinguishable from it.
    tone : float, optional
        Place of the value on the page's scale of colours, 0 to 1.
    """

    text: str
    value: float | str | None = None
    small: str = ""
    best: bool = False
    tone: float | None = None


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes
    ----------
    name : str
        What it is saved as.
    heads : sequence of str
        With units; a second line, in small letters, stands behind a newline.
    rows : sequence of (str, sequence of Cell)
        Each with the estimator that it is of, or an empty text.
    words : sequence of str
        What there is to know of it, a sentence each.
    """

    name: str
    heads: Sequence[str]
    rows: Sequence[tuple[str, Sequence[Cell]]]
    words: Sequence[str] = ()


def number(value: float | None, digits: int = 3) -> str:
    """Return a number for a table; what is not defined is a dash.

    Examples
    --------
    >>> number(1234.0), number(-1234.0), number(0.01234), number(None)
    ('1234', '-1234', '0.0123', '–')
    """
    if value is None or np.isnan(value):
        return "–"
    # 120 and not 1.2e+02
    return f"{value:.0f}" if 10**digits <= abs(value) < 1e5 else f"{value:.{digits}g}"


def short(value: float | None) -> str:
    """Return a number with two digits, also where the second is 0: few seeds carry no third.

    Examples
    --------
    >>> short(0.04764), short(41.67), short(1.04), short(0.0), short(None)
    ('0.048', '42', '1.0', '0', '–')
    """
    if value is None or not np.isfinite(value):
        return "–"
    places = max(0, 1 - int(np.floor(np.log10(abs(value))))) if value else 0
    return f"{value:.{places}f}"


def between(values: Iterable[float | None] | None) -> str:
    """Return the range of some numbers.

    Examples
    --------
    >>> between([0.0382, 0.0731]), between([2.0, 2.01]), between(None)
    ('0.038–0.073', '2.0', '–')
    """
    known = [v for v in values or () if v is not None and np.isfinite(v)] or [np.nan]
    low, high = short(min(known)), short(max(known))
    return low if low == high else f"{low}–{high}"


def pair(interval: Sequence[float | None] | None) -> str:
    """Return an interval; an end that is not finite reads "never"."""
    if interval is None:
        return ""
    return "–".join("never" if end is None else short(end) for end in interval)


def scored(value: float | None, small: str = "", **more: Any) -> Cell:
    """Return a cell with a number, sorted by all of its digits."""
    return Cell(short(value), "" if value is None else value, small, **more)


def _of(name: str) -> Callable[[Row], Cell]:
    def cell(row: Row) -> Cell:
        value, interval = row.get(name), row.get(f"{name}_interval")
        if SCORES[name].kind == "truth":
            return Cell(f"{value} of {row.get('seeds', row.get('runs'))}", value)
        if value is None and name == "t10" and row["changed"]:
            return Cell("never", "")
        return scored(value, pair(interval) if value else "")

    return cell


def over_bound(row: Row) -> Cell:
    """Return the lag over that of the bound."""
    lag, bound = row.get("lag"), row.get("lag_bound")
    return scored(lag / bound if lag is not None and bound else None)


def _false_alarms(row: Row) -> Cell:
    detection = row.get("detection") or {}
    return scored(
        detection.get("false_alarms_per_1000_s"), pair(detection.get("false_alarms_interval"))
    )


COLUMNS: Mapping[str, tuple[str, Callable[[Row], Cell], str]] = {
    "lag": ("lag [s]", _of("lag"), SCORES["lag"].words),
    "over_bound": ("× bound", over_bound, "Lag relative to the lag of the Cramér–Rao bound."),
    "t10": ("time to ±10 % [s]", _of("t10"), SCORES["t10"].words),
    "std": ("std before [%]", _of("std"), SCORES["std"].words),
    "bias": ("bias before [%]", _of("bias"), SCORES["bias"].words),
    "std_after": ("std after [%]", _of("std_after"), SCORES["std_after"].words),
    "score": ("score", _of("score"), SCORES["score"].words),
    "cross_talk": ("cross-talk [%]", _of("cross_talk"), SCORES["cross_talk"].words),
    "diverged": ("lost", _of("diverged"), SCORES["diverged"].words),
    "false_alarms": (
        "false alarms / 1000 s",
        _false_alarms,
        "Changes that the estimator reports where nothing changed, in 1000 s of motion.",
    ),
    "cost": (
        "µs/sample",
        lambda row: scored(row["cost"]["us_per_sample"]),
        "Time of the estimator on this machine; compare within one report only.",
    ),
}
"""What a column of pooled scores shows: its head with the unit, its cell, and what it means."""


def scores(name: str, rows: Sequence[Row], columns: Sequence[str]) -> Table:
    """Return a table of pooled rows, a line a parameter and estimator."""
    heads = ["estimator", "parameter", *(COLUMNS[each][0] for each in columns)]
    lines = [
        (
            row["estimator"],
            [Cell(row["estimator"]), Cell(row["parameter"])]
            + [COLUMNS[each][1](row) for each in columns],
        )
        for row in rows
    ]
    return Table(name, heads, lines)
