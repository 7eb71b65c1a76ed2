"""Open a log file in any supported format, and read its columns with their names and units."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import mode
from typing import Any, NamedTuple

import h5py
import numpy as np
import pandas as pd
from scipy.io import loadmat

from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.signals import Array
from flexaxis.experiments.logs.units import is_unit

PROBE = 1 << 17  # number of bytes at the beginning of a file from which its layout is detected
COMPARED = 200  # maximum number of lines from which the layout is detected
COMMENTS = ("#", "%", "//")
MISSING = ["", "-", "--", "na", "n/a", "null", "none", "N.A."]
_UNIT = re.compile(r"(?P<name>.*?)\s*(?:[\[(]|\s/\s|\sin\s)\s*(?P<unit>[^\])]*?)\s*[\])]?")


class Log(NamedTuple):
    """The columns of a log file, and their units.

    Attributes
    ----------
    columns : dict of str to Series
        Values of each column, as numbers or as text.
    units : dict of str to str
        Units that the file states for its columns.
    """

    columns: Mapping[str, pd.Series[Any]]
    units: Mapping[str, str]

    def read(self, names: Sequence[str], rows: slice = slice(None)) -> dict[str, Array]:
        """Return the named columns (N,) as a dict. Missing values are NaN.

        Raises
        ------
        LogError
            If a column does not exist or does not consist of numbers.
        """
        for name in names:
            if name not in self.columns:
                raise LogError(
                    f"there is no column {name!r}. The columns are {', '.join(self.columns)}"
                )
        return {name: _numbers(name, self.columns[name][rows]) for name in names}


def open_log(path: Path, header: int | None = None) -> Log:
    """Open a log.

    Parameters
    ----------
    path : Path
        Path of a CSV file, a MAT file, or an HDF5 file such as NetCDF-4. The separator of a CSV
        file is ``,``, ``;``, ``|``, a tab or spaces. Decimal commas are allowed. The encoding is
        UTF-8, UTF-16 or Latin-1. Columns of a matrix are named ``name[0]``, ``name[1]``, ….
        Columns of structures and groups are named ``outer.inner``.
    header : int, optional
        Number of the line that contains the column names of a CSV file, counted from 1. By default,
        this line is detected from the content of the file.

    Raises
    ------
    LogError
        If the file cannot be read, or if a CSV file contains no columns of numbers.
    """
    try:
        with path.open("rb") as file:
            start = b"".join(file.readlines(PROBE))
        if h5py.is_hdf5(path):
            with h5py.File(path) as content:
                return Log(dict(_flattened(content)), {})
        if start.startswith(b"MATLAB"):
            return Log(dict(_flattened(loadmat(path, simplify_cells=True))), {})
        return _csv(path, start, header)
    except Exception as error:  # for damaged files, the libraries raise many kinds of exceptions
        raise LogError(f"cannot be read: {str(error).strip()}") from error


def _flattened(
    content: Mapping[str, Any], before: str = ""
) -> Iterator[tuple[str, pd.Series[float]]]:
    """Yield the name and the values of each column in nested structures.

    The elements of an array of structures are named after their field ``Name`` or ``label``.
    Elements without such a field are numbered.
    """
    for name, value in content.items():
        item: Any = value
        if name.startswith(("__", "#")):  # keys that scipy adds, and the content of MATLAB's cells
            continue
        if isinstance(value, list):
            parts = [part for part in value if isinstance(part, Mapping)]
            item = {x.get("Name") or x.get("label") or f"{i}": x for i, x in enumerate(parts, 1)}
        if isinstance(item, Mapping):
            yield from _flattened(item, f"{before}{name}.")
            continue
        array = np.squeeze(item)
        if array.dtype.kind in "fiub" and array.ndim in {1, 2}:
            rows = np.atleast_2d(array).astype(float)
            rows = min(rows, rows.T, key=len)  # the longer side is time
            for j, row in enumerate(rows):
                yield f"{before}{name}" + f"[{j}]" * (len(rows) > 1), pd.Series(row)


def _csv(path: Path, start: bytes, header: int | None) -> Log:
    """Open a text table with the separator that gives the most numbers."""
    encoding = _encoding(start)
    lines = start.decode(encoding, "replace").splitlines()
    kept = [k for k, x in enumerate(lines) if x.strip() and not x.lstrip().startswith(COMMENTS)]
    part = [lines[k] for k in kept[:COMPARED]] or [""]
    tried = [(*_tried(part, mark), mark) for mark in (*";\t,|", None)]
    share, width, row, separator = max(tried, key=lambda layout: layout[:2])
    if share <= 0:
        raise ValueError("it is not a MAT file, an HDF5 file or a CSV file with rows of numbers")
    first = kept[row]
    head = _head(lines[:first], separator, width)
    if header:
        head = _cells(lines[header - 1], separator)
    names, units = names_and_units([*head, *[""] * width][:width])
    table = pd.read_csv(
        path, sep=separator or r"\s+", names=names, header=None, skiprows=first,
        index_col=False, encoding=encoding, encoding_errors="replace",
        skipinitialspace=True, na_values=MISSING, low_memory=False,
        comment=next((x[0] for x in lines if x.startswith(COMMENTS[:2])), None),
    )  # fmt: skip
    # the last line of a log may be incomplete, so its cells are compared with the previous line
    alike = (table[-2:].notna().nunique() < 2).all()
    return Log(dict(table if alike else table[:-1]), units)


def _encoding(start: bytes) -> str:
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    try:
        start.decode()
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def _cells(line: str, separator: str | None) -> list[str]:
    return [cell.strip(' "') for cell in line.split(separator)]


def _tried(lines: Sequence[str], separator: str | None) -> tuple[float, int, int]:
    """Return the score of a separator, the number of cells per row, and the first row of numbers.

    The score increases with the number of numeric cells that the separator yields.
    """
    cells = [_cells(line, separator) for line in lines]
    width = mode(map(len, cells))
    table = pd.DataFrame([(row + [""] * width)[:width] for row in cells])
    points = table.replace(",", ".", regex=True)
    numbers = points.apply(pd.to_numeric, errors="coerce").notna()
    numeric = numbers[len(numbers) // 2 :].mean() > 0.5  # the second half is below any header
    rows = (numbers | table.isin(MISSING)).loc[:, numeric].all(axis=1) & numbers.any(axis=1)
    first = int(np.argmax(rows))
    return (2 * numeric.mean() - 1) * rows[first:].mean(), width, first


def _head(lines: Sequence[str], separator: str | None, width: int) -> list[str]:
    """Return the names of the columns, each with its unit if a line of units follows the names.

    The names are on the last line above the rows of numbers, or in a comment, as in files that
    numpy writes. TwinCAT writes a block of lines in which a key, such as ``Name``, precedes the
    entry of every signal. The first line of such a block contains the names.
    """
    above = sorted(reversed(lines), key=lambda line: line.lstrip().startswith(COMMENTS))
    rows = [_cells(line.lstrip("#%/ "), separator) for line in above]
    block = [row for row in rows if len(row) >= width - 1 and any(row) and not any(row[width:])]
    if len(block) > 1 and any(is_unit(cell.strip("[]() ")) for cell in block[0]):
        return [f"{a} [{b.strip('[]() ')}]" for a, b in zip(block[1], block[0], strict=False)]
    keyed = [row for row in block if row[0] and row.count(row[0]) > 1]
    return keyed[-1] if len(keyed) > 2 else [*block, []][0]


def names_and_units(head: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Return unique column names, and the units that follow the names, without unknown units.

    Examples
    --------
    >>> names_and_units(["t [s]", "phi in deg", "phi in deg", "", "q[3]"])
    (['t', 'phi', 'phi#2', 'column4', 'q[3]'], {'t': 's', 'phi': 'deg', 'phi#2': 'deg'})
    """
    names, units, bare = list[str](), dict[str, str](), list[str]()
    for place, text in enumerate(map(str.strip, head), 1):
        match = _UNIT.fullmatch(text)
        unit = match["unit"] if match and is_unit(match["unit"]) else ""
        name = (match["name"] if match and unit else text) or f"column{place}"
        bare.append(name)
        names.append(f"{name}#{bare.count(name)}" if name in names else name)
        if unit:
            units[names[-1]] = unit
    return names, units


def _numbers(name: str, column: pd.Series[Any]) -> Array:
    """Convert a column to numbers, and date-and-time stamps to seconds since the first stamp."""
    if pd.api.types.is_numeric_dtype(column):
        return column.to_numpy(float)
    texts = column.astype("string").str.strip()
    numbers = pd.to_numeric(texts.str.replace(",", "."), errors="coerce")
    bad = numbers.isna() & texts.notna()
    if not bad.any():
        return numbers.to_numpy(float)
    if bad.all():
        stamps = pd.to_datetime(texts, format="mixed", utc=True, errors="coerce")
        if stamps.notna().all():
            return (stamps - stamps.iloc[0]).dt.total_seconds().to_numpy(float)
    row = bad.idxmax()
    raise LogError(
        f"row {row}, column {name}: {str(texts[row])[:60]!r} is not a number ({bad.sum()} of "
        f"{len(texts)} cells are not numbers). Correct such cells or empty them; empty cells are "
        f"treated as gaps. If a new log begins at row {row}, select the first log with "
        f"--rows 0:{row}"
    )
