"""A result that makes room for another, and is kept until that is complete."""

from __future__ import annotations

import os
import shutil
from contextlib import suppress
from pathlib import Path

from flexaxis.experiments.running.files import writing
from flexaxis.experiments.running.names import COMPLETE, MADE, PREVIOUS, STUDY, SWEEP
from flexaxis.experiments.running.rows import row_files
from flexaxis.experiments.running.traces import TRACES


def is_unfinished(folder: Path) -> bool:
    """Whether a folder has nothing of what is written last."""
    return not any((folder / name).exists() for name in COMPLETE)


def unfinish(folder: Path) -> None:
    """Remove what is made of all rows: there will be others."""
    with writing(folder):
        for name in COMPLETE:
            (folder / name).unlink(missing_ok=True)


def set_aside(folder: Path) -> None:
    """Move a complete result to `previous`; rows of an unfinished one are given up.

    At every moment the old result is whole in one place at least: it is linked to the new place,
    that gets its name at once, and only then what is here goes. First what says that this is
    complete, and last study.json, which without rows does not count.
    """
    names = (*COMPLETE, *(path.name for path in row_files(folder)), *MADE, TRACES, SWEEP, STUDY)
    there = [path for name in names if (path := folder / name).exists()]
    staging = folder / f".{PREVIOUS}"
    with writing(folder):
        if there and there[0].name in COMPLETE:
            _remove(staging)  # of a process that was killed
            staging.mkdir()
            for path in there:
                _link(path, staging / path.name)
            _remove(folder / PREVIOUS)
            os.replace(staging, folder / PREVIOUS)
        for path in there:
            _remove(path)


def _link(source: Path, target: Path) -> None:
    """Give a file, or all files of a folder, a second name; where there are no links, copy it."""
    if source.is_dir():
        shutil.copytree(source, target, copy_function=_link_file)
    else:
        _link_file(source, target)


def _link_file(source: str | Path, target: str | Path) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def completed(folder: Path) -> None:
    """Remove what a complete result has replaced."""
    _remove(folder / PREVIOUS)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    with suppress(FileNotFoundError, IsADirectoryError, PermissionError):
        path.unlink()
