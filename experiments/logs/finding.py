"""Which files of a folder are logs, and in which order."""

from __future__ import annotations

import re
from collections.abc import Sequence
from os.path import commonpath
from pathlib import Path

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.own import made_of

SUFFIXES = (
    ".csv", ".tsv", ".txt", ".log", ".dat", ".mat", ".h5", ".hdf5", ".nc", ".parquet", ".mcap",
    ".bag", ".db3",
)  # fmt: skip


def find_logs(given: Sequence[Path]) -> list[Path]:
    """Return the logs in folders and among files, those of a folder in the order of their names.

    What was made of a log in the same folder, by `import` or `track`, is no further log. A folder
    without logs may have them in folders of its own, such as one a day.

    Raises
    ------
    LogError
        If something is missing, or there is no log.
    """
    found: list[Path] = []
    for path in given:
        if path.is_dir():
            found += _in(path) or _below(path)
        elif path.exists():
            found.append(path)
        else:
            raise LogError(f"{path}: no such file or folder")
    if not found:
        raise LogError(
            f"{', '.join(map(str, given))}: there is no log, which would end in "
            f"{', '.join(SUFFIXES)}"
        )
    return list(dict.fromkeys(found))


def labels(logs: Sequence[Path]) -> dict[Path, str]:
    """Return names that tell logs apart: of the files, or with their folders if those are alike."""
    if len({path.name for path in logs}) == len(logs):
        return {path: path.name for path in logs}
    root = Path(commonpath([path.absolute().parent for path in logs]))
    return {path: path.absolute().relative_to(root).as_posix() for path in logs}


def _in(folder: Path) -> list[Path]:
    inside = [p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES and p.is_file()]
    names = {p.name for p in inside}
    logs = (p for p in inside if p.name[0] != "." and not made_of(p, names))
    return sorted(logs, key=_natural)


def _below(folder: Path) -> list[Path]:
    below = (p for p in folder.iterdir() if p.is_dir() and p.name[0] != ".")
    return [log for p in sorted(below, key=_natural) for log in _in(p) or _below(p)]


def _natural(path: Path) -> list[tuple[int, str]]:
    """Return what sorts log_9 before log_10."""
    return [(int(t or -1), "") if t.isdigit() else (-1, t) for t in re.split(r"(\d+)", path.name)]
