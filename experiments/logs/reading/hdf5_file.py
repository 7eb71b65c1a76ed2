"""Logs in HDF5: NetCDF-4 and MAT v7.3 are such, too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading.log import LONGEST, WIDEST, Array, Log, columns_of


def open_file(path: Path) -> Log:
    """Open one; see `reader.open_log`."""
    with path.open("rb") as file:
        matlab = file.read(6) == b"MATLAB"
    try:
        import h5py
    except ImportError as error:
        kind = "a MAT v7.3 file, which is HDF5" if matlab else "HDF5"
        raise LogError(
            f"{path}: this is {kind}, and h5py is not installed: pip install h5py, or save it "
            "with save(…, '-v7') in MATLAB"
        ) from error

    from flexaxis.sim.hdf5_inside import only_inside

    places: dict[str, str] = {}
    units: dict[str, str] = {}

    def visit(name: str, item: Any) -> None:
        # "#refs#" is where MATLAB keeps the inside of cells
        if not isinstance(item, h5py.Dataset) or name.startswith("#"):
            return
        for column in _columns(path, name, item):
            places[column] = name
            unit = item.attrs.get("units", "")
            units[column] = unit.decode(errors="replace") if isinstance(unit, bytes) else str(unit)

    def read_all(names: Sequence[str]) -> dict[str, Array]:
        found: dict[str, Array] = {}
        with h5py.File(path) as file:
            only_inside(file, lambda text: LogError(f"{path}: {text}"))
            for place in dict.fromkeys(places[name] for name in names):
                found |= dict(columns_of(place.replace("/", "."), file[place][()]))
        return {name: found[name] for name in names}

    _guarded(path, lambda: _visit(path, visit))
    stated = {name: unit for name, unit in units.items() if unit}

    def read(names: Sequence[str], *, strict: bool = True) -> Mapping[str, Array]:
        return _guarded(path, lambda: read_all(names))  # type: ignore[no-any-return]

    return Log(path.name, tuple(places), read, stated)


def _visit(path: Path, visit: Any) -> None:
    import h5py

    from flexaxis.sim.hdf5_inside import only_inside

    with h5py.File(path) as file:
        only_inside(file, lambda text: LogError(f"{path}: {text}"))
        file.visititems(visit)


def _columns(path: Path, name: str, item: Any) -> list[str]:
    """Return the names of the columns of a data set, without reading it."""
    key = name.replace("/", ".")
    shape = tuple(n for n in item.shape if n != 1) if item.shape is not None else ()
    if item.dtype.kind not in "fiub" or item.dtype.names is not None or not shape:
        return []
    if max(shape) > LONGEST or np.prod(shape, dtype=float) > LONGEST * WIDEST:
        raise LogError(
            f"{path}: {key} says that it holds {max(shape)} samples; no more than {LONGEST} can be "
            "read, so take a piece of it"
        )
    if len(shape) == 1:
        return [key] if shape[0] > 1 else []
    if len(shape) != 2 or min(shape) > WIDEST:
        return []
    return [f"{key}[{j}]" for j in range(min(shape))]


def _guarded(path: Path, do: Any) -> Any:
    """Do something with a file, and say in one line what is wrong with it."""
    try:
        return do()
    except LogError:
        raise
    except Exception as error:  # the HDF5 stack has many exceptions, and no common one
        raise LogError(f"{path}: no HDF5 file, or a broken one ({error})") from error
