"""The JSON of a result with its own checksum: study.json and summary.json say if they changed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from flexaxis.experiments.running.files import OutputError, write_json
from flexaxis.experiments.running.names import STUDY, SUMMARY
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.reading import Refusal, json_value, read_text

SEAL = "seal"
"""Key of the checksum: SHA-256 of all else, with its keys in order."""


def write_sealed(path: Path, content: Mapping[str, Any]) -> None:
    """Write a table with its checksum, at once or not at all; errors as from `write_json`."""
    write_json(path, {**content, SEAL: _checksum(content)})


def read_sealed(path: Path, refuse: Refusal) -> dict[str, Any]:
    """Return a table without its checksum; one without any, as older versions wrote, is taken.

    Parameters
    ----------
    path : Path
    refuse : callable
        Makes the error that is raised, from its message.
    """
    content = json_value(read_text(path, refuse), source=str(path), refuse=refuse)
    if not isinstance(content, dict):
        raise refuse(f"{path}: holds no table")
    seal = content.pop(SEAL, None)
    if seal is not None and seal != _checksum(content):
        raise refuse(
            f"{path}: is not as it was written (its checksum is another one): make the result "
            "again, or take the file from a copy"
        )
    return content


@contextmanager
def as_written(folder: Path) -> Iterator[None]:
    """Say that a result is damaged where it cannot be used and no checksum says that it is not.

    Raises
    ------
    OutputError
        In the place of what a table of another shape leads to.
    """
    try:
        yield
    except FlexaxisError:
        raise
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        if all(_is_sealed(folder / name) for name in (STUDY, SUMMARY)):
            raise
        raise OutputError(
            f"{folder}: its files are damaged, changed by hand, or of another version: {error!r}. "
            "Make the result again"
        ) from error


def _is_sealed(path: Path) -> bool:
    try:
        return SEAL in json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return True  # a study has no summary
    except (OSError, ValueError, TypeError, RecursionError):
        return False


def _checksum(content: Mapping[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()
