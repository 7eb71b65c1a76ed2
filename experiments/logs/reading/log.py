"""Opens a log of any format: names and units of its columns, and numbers when they are wanted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading.csv_layout import names_and_units
from flexaxis.sim.errors import did_you_mean

Array = NDArray[np.float64]

WIDEST = 64  # columns that a matrix may have, so that a picture is not taken for signals
LARGEST = 8_000_000_000  # bytes of a file
SHOWN = 40  # names in a message


@dataclass(frozen=True)
class Log:
    """What a file holds: sequences of numbers by name, not yet read.

    Attributes
    ----------
    source : str
        File name, for messages.
    names : tuple of str
    read : callable
        ``read(names, strict=True)``: columns (N,) by name, NaN where a value is missing; one of
        texts is an error, or left out if not strict. See `load` and `numbers`.
    units : dict of str to str
        Units as the file states them, of some columns.
    """

    source: str
    names: tuple[str, ...]
    read: Callable[..., Mapping[str, Array]]
    units: Mapping[str, str] = field(default_factory=dict)

    def load(self, names: Sequence[str]) -> dict[str, Array]:
        """Return some columns.

        Raises
        ------
        LogError
            If there is none of such a name, or it does not hold numbers.
        """
        for name in names:
            if name not in self.names:
                raise LogError(
                    f"{self.source}: there is no column {name!r}."
                    f"{did_you_mean(name, self.names)} There are {shown(self.names)}"
                )
        return dict(self.read(list(dict.fromkeys(names))))

    def numbers(self) -> dict[str, Array]:
        """Return all columns that hold numbers."""
        return dict(self.read(self.names, strict=False))


def shown(names: Sequence[str]) -> str:
    """Return names for a message, the first forty of very many."""
    text = ", ".join(names[:SHOWN])
    more = len(names) - SHOWN
    return f"{text} and {more} more" if more > 0 else text


def columns_of(name: str, array: Any) -> Iterator[tuple[str, Array]]:
    """Yield the columns that an array holds, the long side of a matrix as time; else none."""
    array = np.asarray(array)
    if array.dtype.kind not in "fiub" or array.dtype.names is not None:
        return
    array = np.squeeze(array)
    if array.ndim == 1 and array.size > 1:
        yield name, array.astype(float)
    if array.ndim != 2:
        return
    tall = array if array.shape[0] >= array.shape[1] else array.T
    if tall.shape[1] > WIDEST:
        return
    for j, column in enumerate(tall.T):
        yield f"{name}[{j}]", column.astype(float)


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
        kind = _kind(path)
        if kind == "parquet":
            log = _parquet(path)
        else:
            module = import_module(f"flexaxis.experiments.logs.reading.{kind}_file")
            log = module.open_file(path)
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror or error}") from error
    except MemoryError as error:
        raise LogError(f"{path}: is too large for the memory of this machine") from error
    if not log.names:
        raise LogError(f"{path}: holds no columns of numbers")
    return log


def _kind(path: Path) -> str:
    """Return what a file is, by its first bytes; refuse what is no log."""
    if path.is_dir():
        raise LogError(f"{path}: is a folder; name one of the logs in it")
    if path.stat().st_size > LARGEST:
        raise LogError(f"{path}: is larger than {LARGEST / 1e9:.0f} GB; give a part of it")
    with path.open("rb") as file:
        start = file.read(HEAD)
    if not start:
        raise LogError(f"{path}: is empty")
    if HDF5 in (start[:8], start[512:520]):
        return "hdf5"
    if start.startswith(b"MATLAB") or path.suffix.lower() == ".mat":
        return "mat"
    if start.startswith(b"PAR1"):
        return "parquet"
    for why, heads in _NOT_READ.items():
        if start.startswith(heads):
            raise LogError(f"{path}: {why}")
    if not _is_text(start):
        raise LogError(
            f"{path}: neither CSV nor MAT nor HDF5 nor parquet; convert the log to one of them"
        )
    return "csv"


def _is_text(start: bytes) -> bool:
    """Whether these may be the first bytes of a text: UTF-16 has zeros, at every other byte."""
    marked = start.startswith((b"\xff\xfe", b"\xfe\xff"))
    halves = start[::2].count(0), start[1::2].count(0)
    wide = max(halves) > 0.3 * len(start) / 2 and min(halves) == 0
    return b"\0" not in start or marked or wide


_NOT_READ: dict[str, tuple[bytes, ...]] = {
    "this is a ZIP archive, such as a workbook of Excel: save it as CSV, or unpack it": (
        b"PK\x03\x04",
    ),
    "this is compressed: unpack it first": (b"\x1f\x8b", b"BZh", b"\xfd7zXZ"),
    "this is NetCDF-3; convert it with nccopy -k netCDF-4 OLD.nc NEW.nc": (
        b"CDF\x01", b"CDF\x02", b"CDF\x05",
    ),
    "this is a document; export the log as CSV": (b"%PDF",),
    "this is a bag of ROS, MCAP or SQLite: export its topics as CSV or parquet": (
        b"\x89MCAP", b"#ROSBAG", b"SQLite format 3\0",
    ),
}  # fmt: skip


def _parquet(path: Path) -> Log:
    try:
        from pyarrow import ArrowException, parquet, types
    except ImportError as error:
        raise LogError(
            f"{path}: this is parquet, and pyarrow is not installed: pip install "
            "pyarrow, or save the log as CSV"
        ) from error
    try:
        schema = parquet.read_schema(path)
    except (ArrowException, OSError) as error:
        raise LogError(f"{path}: no parquet file, or a broken one ({error})") from error
    fields = [
        f.name
        for f in schema
        if types.is_floating(f.type) or types.is_integer(f.type) or types.is_boolean(f.type)
    ]
    names, units = names_and_units(fields)
    place = dict(zip(names, fields, strict=True))

    def read(names: Sequence[str], *, strict: bool = True) -> dict[str, Array]:
        try:
            table = parquet.read_table(path, columns=[place[name] for name in names])
        except (ArrowException, OSError) as error:
            raise LogError(f"{path}: broken parquet ({error})") from error
        return {name: np.asarray(table[place[name]].to_numpy(), float) for name in names}

    return Log(path.name, tuple(names), read, units)
