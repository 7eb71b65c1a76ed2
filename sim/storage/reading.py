"""TOML and JSON files: their tables, or one line that says why they cannot be read."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from reprlib import Repr
from typing import Any

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
    try:
        return path.read_text(encoding="utf-8-sig")  # some editors begin with a mark
    except OSError as error:
        raise refuse(f"{path}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise refuse(f"{path}: not UTF-8 text, from byte {error.start} on") from error
    except ValueError as error:  # a name with a null
        raise refuse(f"{path}: cannot be read: {error}") from error


def toml_tables(text: str, *, source: str, refuse: Refusal) -> dict[str, Any]:
    """Return the tables of a TOML text; `source` is what messages call it."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise refuse(f"{source}: not valid TOML: {error}") from error


def json_value(text: str | bytes, *, source: str, refuse: Refusal) -> Any:
    """Return the value of a JSON text; `source` is what messages call it."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise refuse(f"{source}: not valid JSON: {error}") from error
