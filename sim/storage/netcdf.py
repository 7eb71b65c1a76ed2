"""One way to write NetCDF-4: files whole or not at all, variables with unit and meaning."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np
from numpy.typing import ArrayLike

from flexaxis.sim.storage.atomic_files import atomic


@contextmanager
def new_netcdf(path: str | os.PathLike[str]) -> Iterator[h5netcdf.File]:
    """Yield a NetCDF-4 file to fill, which at the end takes the place of `path`.

    Parameters
    ----------
    path : path-like
        File to make or to replace; its folder must exist.

    Yields
    ------
    h5netcdf.File
        Open for writing; of any length, for it is no more in memory than HDF5 wants it to be.

    Raises
    ------
    OSError
        If it cannot be written; the old file stays.
    """
    with _whole(path) as target, h5netcdf.File(target, "w") as file:
        yield file


@contextmanager
def _whole(path: str | os.PathLike[str]) -> Iterator[_Target]:
    with atomic(path) as new, _Target(new) as target:
        yield target
        if target.error is not None:
            raise target.error


class _Target(io.RawIOBase):
    """A file that takes everything and keeps the first error, such as that of a full disk, for us.

    HDF5 cannot close a file that it cannot write, and ends the process with that.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("w+b", buffering=0)
        self.error: OSError | None = None

    def close(self) -> None:
        self._file.close()
        super().close()

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def readinto(self, buffer: Any) -> int:
        count = self._file.readinto(buffer)
        buffer[count:] = bytes(len(buffer) - count)  # of what could not be written
        return len(buffer)

    def write(self, data: Any) -> int:
        written = 0
        try:
            while self.error is None and written < len(data):
                written += self._file.write(data[written:])
        except OSError as error:
            self.error = error
        self._file.seek(len(data) - written, os.SEEK_CUR)
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        try:
            return self._file.truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0


def declare(
    group: h5netcdf.Group,
    name: str,
    dimensions: Mapping[str, int],
    kind: Any,
    *,
    units: str = "",
    long_name: str = "",
    compress: bool = False,
) -> h5netcdf.Variable:
    """Add a variable to be filled, and those of its dimensions that are not there yet.

    Parameters
    ----------
    group : h5netcdf.Group
        A file from `new_netcdf`, or a group in it.
    name : str
    dimensions : mapping of str to int
        Name and length, in order. NetCDF wants each of a variable to be another one.
    kind : type or dtype
        `str`, `bool` (kept as int8), or a number of numpy.
    units, long_name : str
        Attributes; left out where empty.
    compress : bool
        For what hardly ever changes.

    Returns
    -------
    h5netcdf.Variable
        Takes ``variable[span] = values``.

    Raises
    ------
    ValueError
        If a dimension has another length already.
    """
    for dimension, length in dimensions.items():
        if dimension not in group.dimensions:
            group.dimensions[dimension] = length
        elif group.dimensions[dimension].size != length:
            raise ValueError(
                f"{name}: {length} values along {dimension!r}, which has "
                f"{group.dimensions[dimension].size}"
            )
    types: dict[Any, Any] = {str: h5py.string_dtype(), bool: np.int8}
    how = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if compress else {}
    variable = group.create_variable(name, tuple(dimensions), types.get(kind, kind), **how)
    said = {"units": units, "long_name": long_name}
    variable.attrs.update({key: text for key, text in said.items() if text})
    return variable


def add(
    group: h5netcdf.Group,
    name: str,
    dimensions: Sequence[str],
    values: ArrayLike,
    *,
    units: str = "",
    long_name: str = "",
    compress: bool = False,
) -> None:
    """Add a variable with its values: numbers, truths or texts; all else as in `declare`."""
    array = np.asarray(values)
    kind: Any = {"U": str, "O": str, "b": bool}.get(array.dtype.kind, array.dtype)
    lengths = dict(zip(dimensions, array.shape, strict=True))
    variable = declare(
        group, name, lengths, kind, units=units, long_name=long_name, compress=compress
    )
    variable[...] = array.astype(object) if kind is str else array
