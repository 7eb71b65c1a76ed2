"""Files that results are written to: whole or not at all, and never over an input."""

import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from flexaxis.sim.errors import FlexaxisError, did_you_mean
from flexaxis.sim.files import atomic, json_value, read_text

REPORT, SUMMARY = "report.html", "summary.json"
PathLike = str | os.PathLike[str] | None


class OutputError(FlexaxisError):
    """A result cannot be written or read."""


class StudyError(FlexaxisError):
    """A study is wrong or cannot continue; the message has one line for each problem."""


class NotRun(FlexaxisError):
    """Cases are missing because of the machine (disk, memory); the same command resumes."""


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an `OSError` into an `OutputError` that names the file, the reason and the next step."""
    try:
        yield
    except OSError as error:
        reason = f"{path}: cannot be written: {error.strerror or error}"
        raise OutputError(f"{reason}. Free some space, or choose another place with -o") from error


def make_folder(path: Path) -> None:
    """Make a folder and its parents.

    Raises
    ------
    OutputError
        If it cannot be made, or is a file.
    """
    with writing(path):
        path.mkdir(parents=True, exist_ok=True)


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """Give a temporary path; at the end its file replaces `path` in one step.

    Raises
    ------
    OutputError
        If it cannot be written; the old file stays.
    """
    with writing(path), atomic(path) as part:
        yield part


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all; errors as from `new_file`."""
    with new_file(path) as part:
        part.write_text(text, encoding="utf-8")


def write_json(path: Path, content: Any) -> None:
    """Write strict, indented JSON; errors as from `new_file`."""
    text = json.dumps(content, allow_nan=False, ensure_ascii=False, indent=1)
    write_text(path, text + "\n")


def summary_of(folder: Path) -> Any:
    """Return what summary.json of a run says.

    Raises
    ------
    OutputError
        If it is missing: the run is not finished.
    """
    path = folder / SUMMARY
    return json_value(read_text(path, OutputError), source=str(path), refuse=OutputError)


def check_not_input(inputs: Iterable[PathLike], *outputs: PathLike) -> None:
    """Refuse to overwrite an input, before anything is computed.

    Parameters
    ----------
    inputs : iterable of path, str or None
        What the command reads. Names that are no files, such as scenarios, are ignored.
    *outputs : path or None

    Raises
    ------
    OutputError
        If an output is an input, by any path or link.
    """
    read = {Path(path).resolve() for path in inputs if path and os.path.exists(path)}
    for output in outputs:
        if output and Path(output).resolve() in read:
            raise OutputError(
                f"{output} is an input of this command and would be overwritten: choose another "
                "place with -o"
            )


def check_file(path: Path) -> None:
    """Raise an OutputError for a file or folder that does not exist, with the nearest name."""
    if not path.exists():
        near = did_you_mean(path.name, [file.name for file in path.parent.glob("*")])
        raise OutputError(f"{path} cannot be read: no such file or folder.{near}")


def optional_package(name: str) -> Any:
    """Return an optional package, or say how to install it.

    Raises
    ------
    StudyError
        If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise StudyError(f"this needs {name}: python -m pip install {name}") from error
