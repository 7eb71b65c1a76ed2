"""Write result files atomically, and never overwrite an input file."""

import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from flexaxis.sim.errors import FlexaxisError, did_you_mean
from flexaxis.sim.text_files import atomic, json_value, read_text

REPORT, SUMMARY = "report.html", "summary.json"
PathLike = str | os.PathLike[str] | None


class OutputError(FlexaxisError):
    """Error if flexaxis cannot write or read a result file."""


class StudyError(FlexaxisError):
    """Error if a study is invalid or cannot continue. The message has one line for each problem."""


class NotRun(FlexaxisError):
    """Error if disk space or memory runs out. To resume the run, repeat the command."""


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Convert an `OSError` to an `OutputError` that names the file, the reason and a remedy."""
    try:
        yield
    except OSError as error:
        reason = f"{path}: cannot be written: {error.strerror or error}"
        raise OutputError(f"{reason}. Free some space, or choose another path with -o") from error


def make_folder(path: Path) -> None:
    """Create a folder and all missing parent folders.

    Raises
    ------
    OutputError
        If the folder cannot be created, for example because the path is a file.
    """
    with writing(path):
        path.mkdir(parents=True, exist_ok=True)


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """Yield the path of a temporary file, which replaces the file `path` on exit.

    Raises
    ------
    OutputError
        If the file cannot be written. In this case, an existing file at this path stays unchanged.
    """
    with writing(path), atomic(path) as part:
        yield part


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically, and raise the same errors as `new_file`."""
    with new_file(path) as part:
        part.write_text(text, encoding="utf-8")


def write_json(path: Path, content: Any) -> None:
    """Write a value as indented standard JSON, and raise the same errors as `new_file`."""
    text = json.dumps(content, allow_nan=False, ensure_ascii=False, indent=1)
    write_text(path, text + "\n")


def summary_of(folder: Path) -> Any:
    """Return the content of summary.json in the results folder of a run.

    Raises
    ------
    OutputError
        If the file is missing, for example because the run has not finished.
    """
    path = folder / SUMMARY
    return json_value(read_text(path, OutputError), source=str(path), refuse=OutputError)


def check_not_input(inputs: Iterable[PathLike], *outputs: PathLike) -> None:
    """Raise an error if an output file would overwrite an input file.

    Parameters
    ----------
    inputs : iterable of path, str or None
        Files that the command reads. The function ignores entries that are not files, such as
        scenario names.
    *outputs : path or None
        Files that the command writes.

    Raises
    ------
    OutputError
        If an output file is also an input file, even under a different path.
    """
    read = {Path(path).resolve() for path in inputs if path and os.path.exists(path)}
    for output in outputs:
        if output and Path(output).resolve() in read:
            raise OutputError(
                f"{output} is an input of this command, so it cannot be the output: choose another "
                "path with -o"
            )


def check_file(path: Path) -> None:
    """If a file or folder does not exist, raise an `OutputError` that suggests a similar name."""
    if not path.exists():
        near = did_you_mean(path.name, [file.name for file in path.parent.glob("*")])
        raise OutputError(f"{path} cannot be read: no such file or folder.{near}")


def optional_package(name: str) -> Any:
    """Import and return an optional package.

    Raises
    ------
    StudyError
        If the package is not installed. The error message contains the command that installs the
        package.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise StudyError(f"install the package {name}: python -m pip install {name}") from error
