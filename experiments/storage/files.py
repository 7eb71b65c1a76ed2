"""The files of a run or a study: their names, how they are written, and what can go wrong.

Each is written whole or not at all, never over what it is made of. study.json says what is
studied; scores.sqlite, or scores-I-of-N.sqlite of each share, has the rows, and what the figures of
a run are drawn from; trajectories/ estimates that were kept; summary.json and
report.html are made of these when all is done.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from hashlib import sha256
from importlib import import_module
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.storage.atomic_files import atomic
from flexaxis.sim.storage.reading import Refusal, json_value, read_text

STUDY, TRAJECTORIES = "study.json", "trajectories"
REPORT = "report.html"
SUMMARY, SWEEP = "summary.json", "sweep"
COMPLETE = (SUMMARY, "compare.json", "sweep.json")
"""What is written last: a folder without any of these is not complete."""
SHORT = 12  # hexadecimal digits: enough to tell versions apart, few enough to read
MADE = (REPORT, "verdict.md", "sweep.svg")


Given = str | os.PathLike[str] | None


class OutputError(FlexaxisError):
    """A result cannot be written or read."""


def dumps(content: Any) -> str:
    """Return strict JSON on one line; a number that is not finite is a programming error."""
    return json.dumps(content, allow_nan=False, ensure_ascii=False)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn a failure to write into one clear line that names the file and the reason."""
    try:
        yield
    except OSError as error:
        remedy = "Choose another place with -o"
        if error.errno in {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}:
            remedy += ", or make room"
        raise OutputError(
            f"{path}: cannot be written: {error.strerror or error}. {remedy}"
        ) from error


def make_folder(path: Path) -> None:
    """Make a folder if it is missing, and those above it.

    Raises
    ------
    OutputError
        If it cannot be made, or is a file.
    """
    if path.exists() and not path.is_dir():
        raise OutputError(f"{path} is a file, and a folder is wanted: choose another with -o")
    with writing(path):
        path.mkdir(parents=True, exist_ok=True)


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """Give a path to write to; what is there at the end takes the place of `path` at once.

    Raises
    ------
    OutputError
        If it cannot be written; whatever was at `path` is still there.
    """
    with writing(path), atomic(path) as part:
        yield part


def write_text(path: Path, text: str) -> None:
    """Write a text file at once or not at all; errors as from `new_file`."""
    with new_file(path) as part:
        part.write_text(text, encoding="utf-8")


def write_json(path: Path, content: Any) -> None:
    """Write strict JSON to be read by people too; errors as from `new_file`."""
    text = json.dumps(content, allow_nan=False, ensure_ascii=False, indent=1)
    write_text(path, text + "\n")


def json_table(path: Path, refuse: Refusal) -> dict[str, Any]:
    """Return the table that a JSON file holds; `refuse` makes the error of another one."""
    content = json_value(read_text(path, refuse), source=str(path), refuse=refuse)
    if not isinstance(content, dict):
        raise refuse(f"{path}: holds no table")
    return content


@contextmanager
def as_written(folder: Path) -> Iterator[None]:
    """Say that a result cannot be read, in the place of what a table of another shape leads to.

    Raises
    ------
    OutputError
    """
    try:
        yield
    except (ArithmeticError, AttributeError, LookupError, TypeError) as error:
        raise OutputError(
            f"{folder}: its files are damaged, changed by hand, or of another version: {error!r}. "
            "Make the result again"
        ) from error


def spare(inputs: Iterable[Given], *outputs: Given) -> None:
    """Refuse to write over an input; to be called before anything is computed.

    Parameters
    ----------
    inputs : iterable of path or str
        What the command reads. None is allowed, and so is what is not there, such as the name of
        a scenario, for that cannot be lost.
    *outputs : path or None
        What it will write.

    Raises
    ------
    OutputError
        If an output is one of the inputs, by whatever path, link or name it is called.
    """
    read = [Path(given) for given in inputs if given and os.path.exists(given)]
    for output in (Path(given) for given in outputs if given):
        if any(same(output, given) for given in read):
            raise OutputError(
                f"{output} is read by this command and would be overwritten: choose another place "
                "with -o"
            )


def same(one: Path, other: Path) -> bool:
    """Whether two paths are one file or folder, also where a part of a path is not there yet."""
    try:
        return os.path.samefile(one, other)
    except OSError:  # at least one does not exist
        return one.resolve() == other.resolve()


class StudyError(FlexaxisError):
    """A study is wrong, or cannot go on; the message has one line for each problem."""


class NotRun(FlexaxisError):
    """Cases are missing, for no fault of theirs: a full disk, no memory; the same line goes on."""


def no_study(folder: Path, reason: Exception | None = None) -> StudyError:
    """Return the error for a folder that holds neither a run nor a study."""
    why = f"{STUDY} is missing or damaged" + (f": {reason}" if reason else "")
    return StudyError(
        f"{folder} is not the folder of a run or a study ({why}). "
        "Make one with `flexaxis run … -o FOLDER` or `flexaxis study FILE.toml -o FOLDER`"
    )


def needed(package: str) -> Any:
    """Return an optional package, or say how to install it.

    Raises
    ------
    StudyError
        If it is not installed.
    """
    try:
        return import_module(package)
    except ImportError as error:
        raise StudyError(f"this needs {package}: python -m pip install {package}") from error


@cache
def digest_of(*parts: str) -> str:
    """Return a digest of the code, models and settings in packages of flexaxis."""
    content = sha256()
    for source in (f for part in parts for f in sources(files(f"flexaxis.{part}"))):
        content.update(source.read_bytes())
    return content.hexdigest()[:SHORT]


def sources(folder: Traversable) -> list[Traversable]:
    """Return the files of code, models and settings in a folder and those inside, by name."""
    found: list[Traversable] = []
    for item in sorted(folder.iterdir(), key=lambda item: item.name):
        if item.is_dir():
            found += sources(item)
        elif item.name.endswith((".py", ".xml", ".toml")):
            found.append(item)
    return found
