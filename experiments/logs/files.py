"""Which files of a folder flexaxis wrote, and may write again."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path

from flexaxis.experiments.files import OutputError, is_same
from flexaxis.experiments.logs.errors import LogError

HEAD = 2048  # bytes in which a file says whose it is
WRITTEN = "written by flexaxis"
"""What stands at the head of files that have room for remarks: axes and simulated logs."""

_MARKS = {".html": b"flexaxis", ".toml": WRITTEN.encode(), ".csv": WRITTEN.encode()}
_ATTRIBUTES = {"versions", "estimator", "flexaxis"}  # of records, estimates, simulated logs


def spare_foreign(*outputs: Path) -> None:
    """Refuse to write over files that flexaxis did not write; called before any work.

    Raises
    ------
    OutputError
    """
    for path in outputs:
        if path.exists() and not _is_ours(path):
            raise OutputError(
                f"{path} exists and was not written by flexaxis: choose another place with -o, or "
                "move it away"
            )


def require_suffix(path: Path, suffix: str, what: str) -> None:
    """Raise a LogError for an output whose name does not say what will be in it."""
    if path.suffix != suffix:
        raise LogError(f"-o {path}: {what} ends in {suffix}; give such a name")


def _is_ours(path: Path) -> bool:
    mark = _MARKS.get(path.suffix)
    if mark is None:
        return bool(_attributes(path).keys() & _ATTRIBUTES)
    with path.open("rb") as file:
        return mark in file.read(HEAD if path.suffix != ".html" else -1)


def is_record(path: Path) -> bool:
    """Whether a file is a record that flexaxis wrote."""
    return path.suffix == ".nc" and path.is_file() and "versions" in _attributes(path)


def made_of(path: Path, names: Collection[str]) -> bool:
    """Whether a file is what flexaxis made of a log: estimates, or the record of one of names."""
    if path.suffix != ".nc":
        return False
    return "estimator" in _attributes(path) or source_of(path) in names


def record_beside(log: Path) -> Path:
    """Return where the record of a log goes by default: beside it, and over nothing but itself."""
    path = log.with_suffix(".nc")
    free = not path.exists() or (not is_same(path, log) and source_of(path) == log.name)
    return path if free else log.with_name(f"{log.stem}-imported.nc")


def source_of(path: Path) -> str | None:
    """Return the name of the log from which a record was imported; None if it was not."""
    try:
        return str(json.loads(_attributes(path)["versions"])["log"])
    except (KeyError, TypeError, ValueError):
        return None


def _attributes(path: Path) -> dict[str, str]:
    """Return the texts that describe a file as a whole; none of a file that cannot be read."""
    import h5py

    try:
        with h5py.File(path) as file:
            return {name: str(value) for name, value in file.attrs.items()}
    except (OSError, RuntimeError, ValueError):
        return {}
