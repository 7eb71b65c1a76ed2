"""The columns of a table of rows; docs/studies.md says what each means."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from flexaxis.experiments.scoring.table import SCORES, Kind, columns, units

COLUMNS: Mapping[str, Kind] = {
    **dict.fromkeys(("case", "hash", "scenario", "base", "estimator", "method"), "text"),
    "seed": "integer",
    "seconds": "number",
    "parameter": "text",
    "changed": "truth",
    **columns(),
    "error": "text",
    "rows": "integer",
    **dict.fromkeys(("cost.us_per_sample", "cost.seconds"), "number"),
    **dict.fromkeys(("cost.host", "cost.versions"), "text"),
}
"""Every column but those of the axes, which are named by the keys that are swept."""

UNITS: Mapping[str, str] = units() | {
    "seconds": "s",
    "cost.us_per_sample": "us",
    "cost.seconds": "s",
}
"""Units of the columns that are numbers; empty for a plain number."""


def told(column: str) -> dict[str, str]:
    """Return what is said of a column of numbers in a file: `units`, `long_name`, `description`.

    Examples
    --------
    >>> told("cost.seconds")
    {'units': 's', 'long_name': 'cost seconds'}
    """
    score, _, part = column.partition(".")
    heading = SCORES[score].heading if score in SCORES else ""
    words = f"{heading or score} {part}".strip().replace("_", " ")
    found = {"units": UNITS.get(column) or "1", "long_name": words}
    return found | ({"description": SCORES[score].words} if score in SCORES else {})


def column_of(rows: Sequence[Mapping[str, Any]], column: str) -> list[Any]:
    """Return a column of rows as they stand in the files of rows; None where there is nothing.

    Parameters
    ----------
    rows : sequence of mapping
    column : str
        One of `COLUMNS`. What has a dot in its name lies in a table inside the row.
    """
    outer, _, key = column.partition(".")
    found = [row.get(outer) for row in rows]
    if key:
        return [inner.get(key) if inner else None for inner in found]
    if column in _ELSE:  # of a run by itself nothing is swept
        found = [
            row.get(_ELSE[column]) if v is None else v for v, row in zip(found, rows, strict=True)
        ]
    return [v if v is None else json.dumps(v) for v in found] if column in _JSON else found


_ELSE = {"base": "scenario", "method": "estimator"}
_JSON = {"isolation"}


def axis_kind(values: Iterable[Any]) -> Kind:
    """Return the kind of column that holds the values of an axis.

    Examples
    --------
    >>> axis_kind([1, 1.5]), axis_kind(["f_m", "k_T"])
    ('number', 'text')
    """
    numbers = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    return "number" if numbers else "text"


def as_text(value: Any) -> str | None:
    """Return the value of an axis of texts, arrays or truths as text."""
    return value if value is None or isinstance(value, str) else json.dumps(value)
