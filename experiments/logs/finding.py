"""Which files of a folder are logs, and in which order."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.own import made_of

SUFFIXES = (
    ".csv", ".tsv", ".txt", ".log", ".dat", ".mat", ".h5", ".hdf5", ".nc", ".parquet", ".mcap",
    ".bag", ".db3",
)  # fmt: skip


def find_logs(given: Sequence[Path]) -> list[Path]:
    """Return the logs in folders and among files, those of a folder in the order of their names.

    What was made of a log in the same folder, by `import` or `track`, is no further log.

    Raises
    ------
    LogError
        If something is missing, or there is no log.
    """
    found: list[Path] = []
    for path in given:
        if path.is_dir():
            inside = [p for p in path.iterdir() if p.suffix.lower() in SUFFIXES and p.is_file()]
            names = {p.name for p in inside}
            logs = (p for p in inside if p.name[0] != "." and not made_of(p, names))
            found += sorted(logs, key=_natural)
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


def _natural(path: Path) -> list[tuple[int, str]]:
    """Return what sorts log_9 before log_10."""
    return [(int(t or -1), "") if t.isdigit() else (-1, t) for t in re.split(r"(\d+)", path.name)]
