"""Format numbers, and convert DataFrames to tables for report pages and the terminal."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

SYMBOL = re.compile(r"(?<![\w-])([A-Za-zΔθσψεμλτ])_([A-Za-z0-9θ]{1,3})(?![A-Za-z0-9_-])")
"""Regular expression for symbols with subscripts, such as f_m, that are not inside longer words."""

COLUMNS = {
    "lag": "lag [s]",
    "over_bound": "× bound",
    "t10": "time to ±10 % [s]",
    "std": "std before [%]",
    "bias": "bias before [%]",
    "diverged": "lost",
    "never_settled": "not settled",
    "score": "score",
    "cross_talk": "cross-talk [%]",
    "detection.false_alarms_per_1000_s": "false alarms / 1000 s",
    "cost.us_per_sample": "µs/sample",
}
"""Column headings of the scores on pages and in the terminal, keyed by score name."""


class Cell(NamedTuple):
    """A table cell with text, a sort value, small text below, and a star for the best value."""

    text: str
    value: Any = None
    small: str = ""
    best: bool = False


class Table(NamedTuple):
    """A table with a name, column headings, one row of cells per estimator, and notes."""

    name: str
    heads: Sequence[str]
    rows: Sequence[tuple[str, Sequence[Cell]]]
    notes: Sequence[str] = ()


def table(name: str, rows: pd.DataFrame, columns: Mapping[str, str]) -> Table:
    """Create a table from some columns of a DataFrame, with confidence intervals in small text.

    Parameters
    ----------
    name : str
        Name of the table.
    rows : DataFrame
        Scores with a column ``estimator``.
    columns : mapping of str to str
        Column headings of the table, keyed by the column names in `rows`.
    """
    lines = [(row["estimator"], [_cell(row, column) for column in columns])
             for row in rows.to_dict("records")]  # fmt: skip
    return Table(name, list(columns.values()), lines)


def _cell(row: Mapping[str, Any], column: str) -> Cell:
    value, interval = row.get(column), row.get(f"{column}_interval")
    if isinstance(value, str):
        return Cell(value)
    small = between(interval) if isinstance(interval, list | tuple) and value else ""
    return Cell(short(value), "" if pd.isna(value) else number(value, 4), small)


def flat(rows: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Convert pooled scores to a DataFrame, and add the column `over_bound`.

    The column name of a nested score contains all keys, separated by dots.
    """
    flat = pd.json_normalize(list(rows))
    return flat.assign(over_bound=pd.to_numeric(flat["lag"]) / pd.to_numeric(flat["lag_bound"]))


def number(value: float | None, digits: int = 3) -> str:
    """Return a number as text for a table, or a dash for None.

    Examples
    --------
    >>> number(1234.0), number(-1234.0), number(0.01234), number(None)
    ('1234', '-1234', '0.0123', '–')
    """
    if value is None:
        return "–"
    # With the format g alone, 1234 would become 1.23e+03.
    return f"{value:.0f}" if 10**digits <= abs(value) < 1e5 else f"{value:.{digits}g}"


def short(value: float | None) -> str:
    """Return a number as text with two significant digits, or a dash for None and NaN.

    Examples
    --------
    >>> short(0.04764), short(41.67), short(1.04), short(0), short(None)
    ('0.048', '42', '1.0', '0', '–')
    """
    if value is None or not np.isfinite(value):
        return "–"
    if isinstance(value, int) or not value:
        return f"{value:.0f}"
    return f"{value:.{max(0, 1 - int(np.floor(np.log10(abs(value)))))}f}"


def between(values: Iterable[float | None] | None) -> str:
    """Return the range of several numbers as text, such as "0.038–0.073".

    Examples
    --------
    >>> between([0.0382, 0.0731]), between([2.0, 2.01]), between(None)
    ('0.038–0.073', '2.0', '–')
    """
    known = pd.Series(values, dtype=float).dropna()
    low, high = short(known.min()), short(known.max())
    return low if low == high else f"{low}–{high}"
