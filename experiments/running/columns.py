"""The columns of a table of rows; docs/studies.md says what each means."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from flexaxis.experiments.scoring.table import Kind, columns

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


def flat(row: Mapping[str, Any], axes: Sequence[str]) -> dict[str, Any]:
    """Return a row as a line of a table: tables inside it as dotted columns, the axes last.

    Parameters
    ----------
    row : mapping
        As in the files of rows.
    axes : sequence of str
        Swept keys; None where one does not apply to the row's estimator.
    """
    line: dict[str, Any] = {}
    for column in COLUMNS:
        table, _, key = column.partition(".")
        value = row.get(table)
        line[column] = (value or {}).get(key) if key else value
    if line["isolation"] is not None:
        line["isolation"] = json.dumps(line["isolation"])
    return line | {axis: row["axes"].get(axis) for axis in axes}


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
