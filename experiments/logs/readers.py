"""Columns of numbers out of CSV, MAT, HDF5 and NetCDF files."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.errors import LogError

Array = NDArray[np.float64]

WIDEST = 64  # columns that a matrix may have, so that a picture is not taken for signals
_UNIT = re.compile(r"^\s*(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]\s*$")


@dataclass(frozen=True)
class Columns:
    """What a file holds: sequences of numbers by name.

    Attributes
    ----------
    source : str
        File name, for messages.
    values : dict of str to ndarray (N,)
        NaN where a value is missing.
    units : dict of str to str
        Units as the file states them, of some columns.
    """

    source: str
    values: Mapping[str, Array]
    units: Mapping[str, str]


def read_columns(path: Path) -> Columns:
    """Read all columns of a log; the kind of file is told by its content.

    Parameters
    ----------
    path : Path
        CSV (``,``, ``;``, tab or blank between the columns, names in the first line, units in
        brackets behind them or in the second), MAT up to v7.3, HDF5 or NetCDF-4. Matrices give a
        column ``name[i]`` each, structs and groups ``outer.inner``.

    Raises
    ------
    LogError
        If the file cannot be read, or holds no columns of numbers.
    """
    try:
        with path.open("rb") as file:
            start = file.read(8 * 1024)
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
    if b"\x89HDF\r\n\x1a\n" in start[:8] + start[512:520]:
        values, units = _read_hdf5(path, matlab=start.startswith(b"MATLAB"))
    elif start.startswith(b"MATLAB") or path.suffix.lower() == ".mat":
        values, units = _read_mat(path), {}
    elif b"\0" in start:
        raise LogError(f"{path}: neither CSV nor MAT nor HDF5; convert the log to one of them")
    else:
        values, units = _read_csv(path)
    if not values:
        raise LogError(f"{path}: holds no columns of numbers")
    return Columns(path.name, values, units)


def _read_csv(path: Path) -> tuple[dict[str, Array], dict[str, str]]:
    lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    kept = [(k, line) for k, line in enumerate(lines, 1) if line.strip() and line[0] not in "#%"]
    if len(kept) < 3:
        raise LogError(f"{path}: a CSV needs a line of names and at least two of numbers")
    separator = _separator(kept[0][1])
    head = _cells(kept[0][1], separator)
    if all(map(_is_number, head)):
        raise LogError(f"{path}: the first line holds numbers; put the names of the columns there")
    names, units = _names(head)
    first = 1
    if not any(map(_is_number, _cells(kept[1][1], separator))):  # a line of units
        units |= dict(zip(names, _cells(kept[1][1], separator), strict=False))
        first = 2
    rows = []
    for number, line in kept[first:]:
        cells = _cells(line, separator)
        if len(cells) != len(names):
            raise LogError(
                f"{path}: line {number} has {len(cells)} cells, but there are {len(names)} names"
            )
        rows.append(cells)
    table = {}
    for j, name in enumerate(names):
        column = [_number(row[j]) for row in rows]
        if None not in column:  # a column of texts is no signal
            table[name] = np.array(column, float)
    return table, {name: unit for name, unit in units.items() if unit}


def _separator(line: str) -> str:
    counts = {mark: line.count(mark) for mark in (";", "\t", ",")}
    best = max(counts, key=lambda mark: counts[mark])
    return best if counts[best] else " "


def _cells(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    row = next(csv.reader([line], delimiter=separator))
    if separator == ";":  # where a semicolon separates, the comma may be the decimal point
        row = [re.sub(r"^(\s*[-+]?\d*),(\d+.*)$", r"\1.\2", cell) for cell in row]
    return [cell.strip() for cell in row]


def _names(head: list[str]) -> tuple[list[str], dict[str, str]]:
    names, units = [], {}
    for text in head:
        found = _UNIT.match(text)
        names.append(found[1] if found and found[1] else text)
        if found and found[1]:
            units[names[-1]] = found[2]
    return names, units


def _number(text: str) -> float | None:
    if not text:
        return np.nan
    try:
        return float(text)
    except ValueError:
        return None


def _is_number(text: str) -> bool:
    return bool(text) and _number(text) is not None


def _read_mat(path: Path) -> dict[str, Array]:
    from scipy.io import loadmat

    try:
        content = loadmat(path, simplify_cells=True)
    except Exception as error:  # scipy raises whatever the broken bytes lead to
        raise LogError(f"{path}: no MAT file, or a broken one ({error})") from error
    own = {name: value for name, value in content.items() if not name.startswith("__")}
    return dict(_flatten(own))


def _read_hdf5(path: Path, *, matlab: bool) -> tuple[dict[str, Array], dict[str, str]]:
    try:
        import h5py
    except ImportError as error:
        kind = "a MAT v7.3 file, which is HDF5" if matlab else "HDF5"
        raise LogError(
            f"{path}: this is {kind}, and h5py is not installed: pip install h5py, or save it "
            "with save(…, '-v7') in MATLAB"
        ) from error

    found: dict[str, Any] = {}
    units: dict[str, str] = {}

    def visit(name: str, item: Any) -> None:
        # "#refs#" is where MATLAB keeps the inside of cells
        if not isinstance(item, h5py.Dataset) or name.startswith("#"):
            return
        if item.dtype.kind in "fiub" and item.dtype.names is None:
            key = name.replace("/", ".")
            found[key] = item[()]
            unit = item.attrs.get("units", "")
            units[key] = unit.decode() if isinstance(unit, bytes) else str(unit)

    try:
        with h5py.File(path) as file:
            file.visititems(visit)
    except OSError as error:
        raise LogError(f"{path}: no HDF5 file, or a broken one ({error})") from error
    return dict(_flatten(found)), {name: unit for name, unit in units.items() if unit}


def _flatten(content: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Array]]:
    """Yield the sequences of numbers in nested structures, the long side of a matrix as time."""
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{before}{name}.")
            continue
        array = np.asarray(value)
        if array.dtype.kind not in "fiub" or array.dtype.names is not None:
            continue
        array = np.squeeze(array).astype(float)
        if array.ndim == 1 and array.size > 1:
            yield before + name, array
        elif array.ndim == 2:
            tall = array if array.shape[0] >= array.shape[1] else array.T
            if tall.shape[1] <= WIDEST:
                for j, column in enumerate(tall.T):
                    yield f"{before}{name}[{j}]", column.copy()
