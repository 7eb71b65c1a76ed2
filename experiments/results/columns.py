"""The columns of a table of rows; docs/studies.md says what each means."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from operator import itemgetter
from typing import Any

from flexaxis.experiments.scoring.table import SCORES, Kind, columns, units

COLUMNS: Mapping[str, Kind] = {
    **dict.fromkeys(("case", "hash", "scenario", "base", "estimator", "method"), "text"),
    "seed": "integer",
    "seconds": "number",
    "parameter": "text",
    "changed": "truth",
    **columns(),
    "code": "text",
    "error": "text",
    "rows": "integer",
    **dict.fromkeys(("cost.us_per_sample", "cost.seconds"), "number"),
    **dict.fromkeys(("cost.host", "cost.versions"), "text"),
}
"""Every column but those of the axes, which are named by the keys that are swept."""

NEEDED = frozenset({"scenario", "estimator", "seed"})
"""Columns that every row has."""

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


def columns_of(rows: Sequence[Mapping[str, Any]], axes: Sequence[str]) -> dict[str, list[Any]]:
    """Return rows as they stand in the files of rows column by column, the axes last.

    What has a dot in its name lies in a table inside the row; None is what is not there.
    """
    found = dict(_fields(rows, _PLAIN))
    for table, keys in _TABLES.items():
        inside = _fields([row.get(table) or {} for row in rows], keys)
        found |= {f"{table}.{key}": values for key, values in inside.items()}
    found |= _fields([row.get("axes") or {} for row in rows], axes)
    found["isolation"] = [v if v is None else json.dumps(v) for v in found["isolation"]]
    for column, other in (("base", "scenario"), ("method", "estimator")):
        if None in found[column]:  # of an older run by itself, where nothing is swept
            found[column] = found[other]
    return found


_PLAIN = tuple(name for name in COLUMNS if "." not in name)
_TABLES: dict[str, list[str]] = {}
for _table, _, _key in (name.partition(".") for name in COLUMNS if "." in name):
    _TABLES.setdefault(_table, []).append(_key)


def _fields(rows: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> dict[str, list[Any]]:
    """Return the values of some keys, a list a key."""
    if not keys:
        return {}
    give = itemgetter(*keys, keys[0])  # of two keys at least: of one it gives no tuple
    try:
        columns = list(zip(*map(give, rows), strict=True))
    except KeyError:
        nothing = dict.fromkeys(keys)
        columns = list(zip(*(give({**nothing, **row}) for row in rows), strict=True))
    return {key: list(values) for key, values in zip(keys, columns, strict=False)}


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
