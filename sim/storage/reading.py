"""Tables of unknown origin, as TOML or JSON: read within limits, or refused in one line."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from reprlib import Repr
from typing import Any

LARGEST = 40_000_000
"""Characters of a file; the largest that flexaxis writes, the summary of all estimators on the
standard suite, has half."""

DEEPEST = 20
"""Levels of tables and arrays; no file of ours has more than eight."""

LONGEST = 20_000
"""Characters of a text; a key has no more than a fiftieth."""

GREATEST = 1e100
"""Modulus of a number: squares and products of a few of them are still finite."""

_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 60
_SHORT.maxlevel = 3

Refusal = Callable[[str], Exception]


def shown(value: object) -> str:
    """Return a value as a message shows it: as Python writes it, shortened where it is long.

    Examples
    --------
    >>> shown(5.0), shown("k_t")
    ('5.0', "'k_t'")
    >>> len(shown("a" * 1000))
    60
    """
    return _SHORT.repr(value)


def read_toml(path: Path, refuse: Refusal) -> dict[str, Any]:
    """Return the tables of a TOML file.

    Parameters
    ----------
    path : Path
    refuse : callable
        Makes the error that is raised from its message, such as ``ScenarioError``.
    """
    return toml_tables(read_text(path, refuse), source=str(path), refuse=refuse)


def read_text(path: Path, refuse: Refusal) -> str:
    """Return the text of a file; errors as from `read_toml`."""
    if path.is_fifo() and not path.is_relative_to("/dev"):  # that of a shell's <(…) has a writer
        raise refuse(f"{path}: a pipe, which may wait for ever: write it to a file, and give that")
    try:
        with path.open(encoding="utf-8-sig") as file:  # some editors begin with a mark
            text = file.read(LARGEST + 1)
    except OSError as error:
        raise refuse(f"{path}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise refuse(f"{path}: not UTF-8 text, from byte {error.start} on") from error
    except ValueError as error:  # a name with a null
        raise refuse(f"{path}: cannot be read: {error}") from error
    return text


def toml_tables(text: str, *, source: str, refuse: Refusal) -> dict[str, Any]:
    """Return the tables of a TOML text; `source` is what messages call it."""
    return dict(_within(_parsed(tomllib.loads, text, "TOML", source, refuse), source, refuse))


def json_value(text: str | bytes, *, source: str, refuse: Refusal) -> Any:
    """Return the value of a JSON text; `source` is what messages call it."""
    return _within(_parsed(json.loads, text, "JSON", source, refuse), source, refuse)


def _parsed(
    parse: Callable[[Any], Any], text: str | bytes, kind: str, source: str, refuse: Refusal
) -> Any:
    if len(text) > LARGEST:
        raise refuse(f"{source}: larger than {LARGEST} characters, which nothing here asks for")
    try:
        return parse(text)
    except RecursionError as error:
        raise refuse(f"{source}: not valid {kind}: nested deeper than {DEEPEST} levels") from error
    except ValueError as error:  # of the grammar, of numbers with thousands of digits, of dates
        raise refuse(f"{source}: not valid {kind}: {error}") from error


def _within(content: Any, source: str, refuse: Refusal) -> Any:
    """Return a value unless something in it is beyond the limits."""
    if _is_plain(content, 1):  # as nearly all are: then no places need be named
        return content
    left = [("", content, 1)]
    while left:
        key, value, level = left.pop()
        problem = _excess(value, level)
        if problem:
            raise refuse(f"{source}: {key[:200] or 'the whole'}: {problem}")
        left += [(name, entry, level + 1) for name, entry in _entries(key, value)]
    return content


def _is_plain(value: Any, level: int) -> bool:
    """Whether nothing in a value is beyond the limits; False of what only a closer look tells."""
    plain = level <= DEEPEST
    match value:
        case float() | int():
            plain &= -GREATEST <= value <= GREATEST
        case str():
            plain &= len(value) <= LONGEST
        case list():
            plain = plain and all([_is_plain(entry, level + 1) for entry in value])
        case dict():
            plain = plain and all([len(name) <= LONGEST // 50 for name in value])
            plain = plain and all([_is_plain(entry, level + 1) for entry in value.values()])
    return plain


def _entries(key: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        yield from ((f"{key}.{name}" if key else name, entry) for name, entry in value.items())
    elif isinstance(value, list):
        yield from ((f"{key}[{i}]", entry) for i, entry in enumerate(value))


def _excess(value: Any, level: int) -> str:
    if level > DEEPEST:
        return f"nested deeper than {DEEPEST} levels"
    if isinstance(value, int | float) and GREATEST < abs(value) < float("inf"):
        return f"{shown(value)} is beyond ±{GREATEST:g}, which no quantity here can be"
    if isinstance(value, str) and len(value) > LONGEST:
        return f"a text of {len(value)} characters; {LONGEST} are allowed"
    if isinstance(value, dict) and any(len(str(name)) > LONGEST // 50 for name in value):
        return f"a key of more than {LONGEST // 50} characters"
    return ""
