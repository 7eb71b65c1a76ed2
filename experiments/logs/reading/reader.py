"""Opens a log of any of the formats; the kind of file is told by its content."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading.log import Log

HEAD = 4096  # bytes by which a kind is told

HDF5 = b"\x89HDF\r\n\x1a\n"


def open_log(path: Path) -> Log:
    """Open a log.

    Parameters
    ----------
    path : Path
        CSV (``,``, ``;``, tab or blanks between the columns, decimal points or commas, UTF-8,
        UTF-16 or Latin-1), MAT up to v7.3, HDF5, NetCDF-4 or parquet. Matrices give a column
        ``name[i]`` each, structs and groups ``outer.inner``.

    Raises
    ------
    LogError
        If the file cannot be read, or holds no columns of numbers.
    """
    try:
        log = _module(path).open_file(path)  # type: ignore[attr-defined]
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror or error}") from error
    except MemoryError as error:
        raise LogError(f"{path}: is too large for the memory of this machine") from error
    if not log.names:
        raise LogError(f"{path}: holds no columns of numbers")
    return log


def _module(path: Path) -> object:
    if path.is_dir():
        raise LogError(f"{path}: is a folder; name one of the logs in it")
    with path.open("rb") as file:
        start = file.read(HEAD)
    if not start:
        raise LogError(f"{path}: is empty")
    kind = next((kind for kind, has in _KINDS.items() if has(path, start)), "csv")
    if kind in _NOT_READ:
        raise LogError(f"{path}: {_NOT_READ[kind]}")
    return import_module(f"flexaxis.experiments.logs.reading.{kind}_file")


def _is_text(start: bytes) -> bool:
    """Whether these may be the first bytes of a text: UTF-16 has zeros, at every other byte."""
    marked = start.startswith((b"\xff\xfe", b"\xfe\xff"))
    halves = start[::2].count(0), start[1::2].count(0)
    wide = max(halves) > 0.3 * len(start) / 2 and min(halves) == 0
    return b"\0" not in start or marked or wide


_KINDS: dict[str, Callable[[Path, bytes], bool]] = {
    "hdf5": lambda path, start: HDF5 in (start[:8], start[512:520]),
    "mat": lambda path, start: start.startswith(b"MATLAB") or path.suffix.lower() == ".mat",
    "parquet": lambda path, start: start.startswith(b"PAR1"),
    "bag": lambda path, start: start.startswith((b"\x89MCAP", b"#ROSBAG", b"SQLite format 3\0")),
    "zip": lambda path, start: start.startswith(b"PK\x03\x04"),
    "gzip": lambda path, start: start.startswith((b"\x1f\x8b", b"BZh", b"\xfd7zXZ")),
    "netcdf3": lambda path, start: start.startswith((b"CDF\x01", b"CDF\x02", b"CDF\x05")),
    "pdf": lambda path, start: start.startswith(b"%PDF"),
    "other": lambda path, start: not _is_text(start),
}

_NOT_READ = {
    "zip": "this is a ZIP archive, such as a workbook of Excel: save it as CSV, or unpack it",
    "gzip": "this is compressed: unpack it first",
    "netcdf3": "this is NetCDF-3; convert it with nccopy -k netCDF-4 OLD.nc NEW.nc",
    "pdf": "this is a document; export the log as CSV",
    "bag": "this is a bag of ROS, MCAP or SQLite: export its topics as CSV or parquet",
    "other": "neither CSV nor MAT nor HDF5 nor parquet; convert the log to one of them",
}
