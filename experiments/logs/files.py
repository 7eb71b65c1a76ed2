"""Files: which of a folder are logs, and which these commands wrote and may write again."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Sequence
from os.path import commonpath
from pathlib import Path

from flexaxis.experiments.files import OutputError, is_same
from flexaxis.experiments.logs.errors import LogError

HEAD = 2048  # bytes in which a file says whose it is
WRITTEN = "written by flexaxis"
"""What stands at the head of files that have room for remarks: axes and simulated logs."""

_MARKS = {
    ".html": b"<title>flexaxis",
    **dict.fromkeys((".toml", ".csv", ".mat"), WRITTEN.encode()),
}
_ATTRIBUTES = {"versions", "estimator", "flexaxis"}  # of records, estimates, simulated logs


def spare_foreign(*outputs: Path) -> None:
    """Refuse to write over files of somebody else; called before any work.

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


def require_suffix(path: Path, suffix: str, what: str) -> None:
    """Raise a LogError for an output whose name does not say what will be in it."""
    if path.suffix != suffix:
        raise LogError(f"-o {path}: {what} ends in {suffix}; give such a name")


def is_ours(path: Path) -> bool:
    """Whether a file was written by flexaxis; not if that cannot be told."""
    if not path.is_file():
        return False
    if (mark := _MARKS.get(path.suffix)) is not None:
        with path.open("rb") as file:
            return mark in file.read(HEAD)
    return bool(_attributes(path).keys() & _ATTRIBUTES)


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


SUFFIXES = (
    ".csv", ".tsv", ".txt", ".log", ".dat", ".mat", ".h5", ".hdf5", ".nc", ".parquet",
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
