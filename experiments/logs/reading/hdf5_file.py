"""Logs in HDF5; NetCDF-4 and MAT v7.3 are HDF5, too."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading.log import WIDEST, Array, Log, columns_of


def open_file(path: Path) -> Log:
    """Open one; see `log.open_log`."""
    import h5py

    places: dict[str, str] = {}
    units: dict[str, str] = {}

    def visit(name: str, item: Any) -> None:
        # "#refs#" is where MATLAB keeps the inside of cells
        if not isinstance(item, h5py.Dataset) or name.startswith("#"):
            return
        unit = item.attrs.get("units", "")
        text = unit.decode(errors="replace") if isinstance(unit, bytes) else str(unit)
        for column in _names(name, item):
            places[column] = name
            if text:
                units[column] = text

    with _opened(path) as file:
        file.visititems(visit)

    def read(names: Sequence[str], *, strict: bool = True) -> Mapping[str, Array]:
        with _opened(path) as file:
            found = {
                name: column
                for place in dict.fromkeys(places[name] for name in names)
                for name, column in columns_of(place.replace("/", "."), file[place][()])
            }
        return {name: found[name] for name in names}

    return Log(path.name, tuple(places), read, units)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a file, or say in one line what is wrong with it."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            yield file
    except (LogError, MemoryError):
        raise
    except Exception as error:  # the HDF5 stack has many exceptions, and no common one
        raise LogError(f"{path}: no HDF5 file, or a broken one ({error})") from error


def _names(name: str, item: Any) -> list[str]:
    """Return the names of the columns of a data set, without reading it."""
    key = name.replace("/", ".")
    shape = tuple(n for n in item.shape if n != 1) if item.shape is not None else ()
    if item.dtype.kind not in "fiub" or item.dtype.names is not None or not shape:
        return []
    if len(shape) == 1:
        return [key] if shape[0] > 1 else []
    wide = len(shape) != 2 or min(shape) > WIDEST
    return [] if wide else [f"{key}[{j}]" for j in range(min(shape))]
