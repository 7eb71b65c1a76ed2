"""NetCDF-4 files that are written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO

import h5netcdf

from flexaxis.sim.files import atomic


@contextmanager
def new_netcdf(path: str | os.PathLike[str]) -> Iterator[h5netcdf.File]:
    """Yield a NetCDF-4 file to fill, which at the end takes the place of `path`.

    It is filled in memory: the HDF5 library ends the process where a disk is full.

    Parameters
    ----------
    path : path-like
        File to make or to replace; its folder must exist.

    Yields
    ------
    h5netcdf.File
        Open for writing.

    Raises
    ------
    OSError
        If it cannot be written; the old file stays.
    """
    memory = BytesIO()
    with h5netcdf.File(memory, "w") as file:
        yield file
    with atomic(path) as new:
        new.write_bytes(memory.getbuffer())
