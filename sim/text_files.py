"""Write files atomically, and read files with clear error messages."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from reprlib import Repr
from tempfile import TemporaryDirectory
from typing import Any

import tomli_w

Refusal = Callable[[str], Exception]
"""Type of an exception class, such as ``ScenarioError``, or of a function that returns an
exception."""

_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 60
_SHORT.maxlevel = 3

toml_text: Callable[[dict[str, Any]], str] = partial(tomli_w.dumps, multiline_strings=True)
"""Function that converts nested dictionaries to TOML text."""


@contextmanager
def atomic(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path; at the end of the context, move the temporary file to `path`.

    The temporary file is in a hidden folder next to `path`. If an exception occurs in the context,
    an existing file at `path` remains unchanged and the exception propagates.

    Parameters
    ----------
    path : path-like
        File to create or replace; the folder of the file must exist.

    Raises
    ------
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> target = Path(tempfile.mkdtemp()) / "table.csv"
    >>> with atomic(target) as new:
    ...     _ = new.write_text("a,b")
    >>> [file.name for file in target.parent.iterdir()]
    ['table.csv']
    """
    path = Path(path)
    with TemporaryDirectory(
        prefix=".", suffix=".flexaxis", dir=path.parent, ignore_cleanup_errors=True
    ) as folder:
        yield Path(folder, path.name)
        os.replace(Path(folder, path.name), path)


def shown(value: object) -> str:
    """Return the repr of a value for use in an error message, shortened if necessary.

    Examples
    --------
    >>> shown(5.0), shown("k_t")
    ('5.0', "'k_t'")
    >>> len(shown("a" * 1000))
    60
    """
    return _SHORT.repr(value)


def read_toml(path: Path, refuse: Refusal) -> dict[str, Any]:
    """Read the tables of a TOML file; raise the exception `refuse` if the file cannot be read."""
    return toml_tables(read_text(path, refuse), source=str(path), refuse=refuse)


def read_text(path: Path, refuse: Refusal) -> str:
    """Read the text of a file; raise the exception `refuse` if the file cannot be read."""
    try:
        return path.read_text(encoding="utf-8-sig")  # some editors write a byte-order mark
    except OSError as error:
        raise refuse(f"{path}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise refuse(f"{path}: the file is not UTF-8 text (see byte {error.start})") from error


def toml_tables(text: str, *, source: str, refuse: Refusal) -> dict[str, Any]:
    """Parse TOML text; error messages begin with `source`, such as a file path."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise refuse(f"{source}: not valid TOML: {error}") from error


def json_value(text: str | bytes, *, source: str, refuse: Refusal) -> Any:
    """Parse JSON text; error messages begin with `source`, such as a file path."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise refuse(f"{source}: not valid JSON: {error}") from error
