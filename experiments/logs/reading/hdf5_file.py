"""Logs in HDF5, read in a process of their own: NetCDF-4 and MAT v7.3 are such, too."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading import apart
from flexaxis.experiments.logs.reading.log import LONGEST, WIDEST, Array, Log, columns_of
from flexaxis.experiments.logs.reading.mat_file import text_of

MODULE = "flexaxis.experiments.logs.reading.hdf5_file"


def open_file(path: Path) -> Log:
    """Open one; see `log.open_log`."""
    with path.open("rb") as file:
        matlab = file.read(6) == b"MATLAB"
    if find_spec("h5py") is None:
        kind = "a MAT v7.3 file, which is HDF5" if matlab else "HDF5"
        raise LogError(
            f"{path}: this is {kind}, and h5py is not installed: pip install h5py, or save it "
            "with save(…, '-v7') in MATLAB"
        )
    places, units = apart.asked(MODULE, path, "contents")

    def read(names: Sequence[str], *, strict: bool = True) -> Mapping[str, Array]:
        wanted = {name: places[name] for name in names}
        found = apart.columns(MODULE, path, "columns", wanted)
        return {name: found[name] for name in names}

    return Log(path.name, tuple(places), read, units)


def texts_of(path: Path, names: Sequence[str]) -> list[str]:
    """Return the attributes of a file that have some names, in small letters or not, as texts.

    Raises
    ------
    LogError
        If the file cannot be read.
    """
    return [str(text) for text in apart.asked(MODULE, path, "texts", *names)]


def _contents(path: str) -> tuple[dict[str, str], dict[str, str]]:
    """Return where each column lies, and the units that are stated."""
    import h5py

    places: dict[str, str] = {}
    units: dict[str, str] = {}

    def visit(name: str, item: Any) -> None:
        # "#refs#" is where MATLAB keeps the inside of cells
        if not isinstance(item, h5py.Dataset) or name.startswith("#"):
            return
        for column in _names(name, item):
            places[column] = name
            unit = item.attrs.get("units", "")
            text = unit.decode(errors="replace") if isinstance(unit, bytes) else str(unit)
            units[column] = text[: apart.TEXT]

    with h5py.File(path) as file:
        _only_inside(file)
        file.visititems(visit)
    return places, {name: unit for name, unit in units.items() if unit}


def _names(name: str, item: Any) -> list[str]:
    """Return the names of the columns of a data set, without reading it."""
    key = name.replace("/", ".")
    shape = tuple(n for n in item.shape if n != 1) if item.shape is not None else ()
    if item.dtype.kind not in "fiub" or item.dtype.names is not None or not shape:
        return []
    if max(shape) > LONGEST or np.prod(shape, dtype=float) > LONGEST * WIDEST:
        raise LogError(
            f"{key} says that it holds {max(shape)} samples; no more than {LONGEST} can be "
            "read, so take a piece of it"
        )
    if len(shape) == 1:
        return [key] if shape[0] > 1 else []
    if len(shape) != 2 or min(shape) > WIDEST:
        return []
    return [f"{key}[{j}]" for j in range(min(shape))]


def _columns(path: str, out: str, places: Mapping[str, str]) -> list[str]:
    """Keep the columns that are wanted, of which the places are given; return their names."""
    import h5py

    def wanted(file: h5py.File) -> Iterator[tuple[str, Array]]:
        for place in dict.fromkeys(places.values()):
            for name, column in columns_of(place.replace("/", "."), file[place][()]):
                if places.get(name) == place:
                    yield name, column

    with h5py.File(path) as file:
        _only_inside(file)
        return apart.kept(out, wanted(file))


def _texts(path: str, *names: str) -> list[str]:
    import h5py

    with h5py.File(path) as file:
        return [text_of(value) for key, value in file.attrs.items() if key.lower() in names]


def _only_inside(file: Any) -> None:
    from flexaxis.sim.hdf5_inside import only_inside

    only_inside(file, LogError)


def _guarded(answer: Callable[..., Any]) -> Callable[..., Any]:
    """Return an answer that says in one line what is wrong with a file."""

    def guarded(path: str, *words: Any) -> Any:
        try:
            return answer(path, *words)
        except (LogError, MemoryError):
            raise
        except Exception as error:  # the HDF5 stack has many exceptions, and no common one
            raise LogError(f"no HDF5 file, or a broken one ({error})") from error

    return guarded


ANSWERS: apart.Answers = {
    "contents": _guarded(_contents),
    "columns": _guarded(_columns),
    "texts": _guarded(_texts),
}

if __name__ == "__main__":
    apart.serve(ANSWERS)
