"""Writing TOML, which the standard library only reads."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any


def toml_text(content: Mapping[str, Any]) -> str:
    """Return nested keys and values as TOML: plain keys first, then tables, then their arrays.

    Examples
    --------
    >>> print(toml_text({"name": "x", "noise": {"speed": 0.1}}))
    name = "x"
    <BLANKLINE>
    [noise]
    speed = 0.1
    <BLANKLINE>
    >>> print(toml_text({"law": [{"kind": "static", "drive": {"speed_motor": 1.0}}]}))
    <BLANKLINE>
    [[law]]
    kind = "static"
    drive = { speed_motor = 1.0 }
    <BLANKLINE>
    """
    return "\n".join([*_lines(content), ""])


def _lines(content: Mapping[str, Any]) -> Iterator[str]:
    tables = {k: v for k, v in content.items() if isinstance(v, Mapping) or _is_array_of_tables(v)}
    for key, value in content.items():
        if key not in tables:
            yield f"{key} = {_value(value)}"
    for key, value in tables.items():
        header = f"[{key}]" if isinstance(value, Mapping) else f"[[{key}]]"
        for table in [value] if isinstance(value, Mapping) else value:
            yield from ["", header]
            yield from (f"{name} = {_value(entry)}" for name, entry in table.items())


def _is_array_of_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], Mapping)


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        entries = ", ".join(f"{name} = {_value(entry)}" for name, entry in value.items())
        return f"{{ {entries} }}"
    if isinstance(value, str) and "\n" in value:
        return '"""\n' + "\n".join(_value(line)[1:-1] for line in value.split("\n")) + '"""'
    # JSON writes strings, numbers, booleans and arrays of them the way TOML does, but for one
    # control character.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
