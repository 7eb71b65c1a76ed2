"""The columns of a row, in which it is stored; docs/studies.md says what each means."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from typing import Any

from flexaxis.experiments.scoring.score import Kind
from flexaxis.experiments.scoring.table import SCORES, columns, units

COLUMNS: Mapping[str, Kind] = {
    **dict.fromkeys(("case", "hash", "scenario", "base", "estimator", "method"), "text"),
    "seed": "integer",
    "onset": "number",
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

KEY = ("estimator", "code", "hash", "seed", "parameter")
"""What a row is of: its inputs, each of which is once in a folder."""

UNITS: Mapping[str, str] = units() | {
    "onset": "s",
    "seconds": "s",
    "cost.us_per_sample": "us",
    "cost.seconds": "s",
}
"""Units of the columns that are numbers; empty for a plain number."""

_FIRST = ("case", "hash", "scenario", "estimator", "seed", "onset", "parameter", "changed",
          *SCORES)  # fmt: skip
_LAST = ("cost", "base", "method", "axes", "seconds", "code", "rows", "error")
_TABLES: dict[str, list[str]] = {}
for _table, _, _part in (name.partition(".") for name in COLUMNS if "." in name):
    _TABLES.setdefault(_table, []).append(_part)


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


def flat(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row by column, its axes as JSON; what has a dot in its name lies in a table.

    Raises
    ------
    ValueError
        If something in it is not what its column holds; a number that is not finite, too.
    """
    found = {name: row.get(name) for name in COLUMNS if "." not in name}
    for table, parts in _TABLES.items():
        inside = row.get(table) or {}
        found |= {f"{table}.{part}": inside.get(part) for part in parts}
    for name, kind in COLUMNS.items():
        if not _fits(found[name], kind, name):
            raise ValueError(f"{name} is {found[name]!r}, and is to be a {kind}")
    if found["isolation"] is not None:
        found["isolation"] = json.dumps(found["isolation"])
    return found | {"axes": json.dumps(row.get("axes") or {})}


def _fits(value: Any, kind: Kind, name: str) -> bool:
    if value is None or name == "isolation":
        return name not in {"scenario", "estimator", "seed"}
    if kind == "text":
        return isinstance(value, str)
    if kind == "truth":
        return isinstance(value, bool)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value) if kind == "number" else isinstance(value, int) and value >= 0


def nested(line: Mapping[str, Any]) -> dict[str, Any]:
    """Return what `flat` was given, in the order in which rows were always written."""
    found = dict(line)
    for table, parts in _TABLES.items():
        inside = {part: line[f"{table}.{part}"] for part in parts}
        undefined = table != "cost" and all(value is None for value in inside.values())
        if table == "bound":  # of what lies within the record
            inside = {part: value for part, value in inside.items() if value is not None}
        found[table] = None if undefined else inside
    for name, kind in COLUMNS.items():
        if kind == "truth" and found[name] is not None:
            found[name] = bool(found[name])
    if found["isolation"] is not None:
        found["isolation"] = json.loads(found["isolation"])
    found["axes"] = json.loads(found["axes"])
    row = {name: found[name] for name in (*_FIRST, *_LAST)}
    if row["onset"] is None:  # it is not drawn
        del row["onset"]
    return row


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
