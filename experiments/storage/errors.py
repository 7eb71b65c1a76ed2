"""What can go wrong between a plan and its results."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from flexaxis.experiments.storage.names import STUDY
from flexaxis.sim.errors import FlexaxisError


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
