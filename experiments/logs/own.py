"""Files that these commands wrote themselves, and may write again; all others are left alone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.running.files import OutputError
from flexaxis.experiments.running.outputs import same
from flexaxis.sim.reading import read_toml

HEAD = 2048  # bytes in which a page says whose it is
MARK = b"<title>flexaxis"


def spare_foreign(*outputs: Path) -> None:
    """Refuse to write over records, pages and axes of somebody else; called before any work.

    Raises
    ------
    OutputError
        If an output exists and flexaxis did not write it.
    """
    for path in outputs:
        if path.exists() and not is_ours(path):
            raise OutputError(
                f"{path} is there already and was not written by flexaxis: it is left as it is. "
                "Choose another place with -o, or move it away"
            )


def is_ours(path: Path) -> bool:
    """Whether a record, page or axis was written by flexaxis; of other files nobody can tell."""
    if path.suffix == ".html":
        with path.open("rb") as file:
            return MARK in file.read(HEAD)
    if path.suffix == ".toml":
        return {"nominal", "delay"} <= _tables(path).keys()
    return path.suffix != ".nc" or bool(_attributes(path).keys() & {"versions", "estimator"})


def record_beside(log: Path) -> Path:
    """Return where the record of a log goes by default: beside it, and over nothing but itself."""
    path = log.with_suffix(".nc")
    free = not path.exists() or (not same(path, log) and source_of(path) == log.name)
    return path if free else log.with_name(f"{log.stem}-imported.nc")


def source_of(path: Path) -> str | None:
    """Return the name of the log from which a record was imported; None if it was not."""
    try:
        return str(json.loads(_attributes(path)["versions"])["log"])
    except (KeyError, TypeError, ValueError):
        return None


def _tables(path: Path) -> dict[str, Any]:
    """Return the tables of a TOML file; none of one that cannot be read."""
    try:
        return read_toml(path, LogError)
    except LogError:
        return {}


def _attributes(path: Path) -> dict[str, str]:
    """Return the texts that describe a file as a whole; none of a file that cannot be read."""
    import h5py

    try:
        with h5py.File(path) as file:
            return {name: str(value) for name, value in file.attrs.items()}
    except (OSError, RuntimeError, ValueError):
        return {}
