"""Opens a log of any format: names and units of its columns, and their numbers on demand."""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.io import loadmat

from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.units import is_unit
from flexaxis.sim.errors import did_you_mean

Array = NDArray[np.float64]

WIDEST = 64  # columns that a matrix may have, so that a picture is not taken for signals
LARGEST = 8_000_000_000  # bytes of a file
PROBE = 1 << 17  # bytes at the beginning, which show the layout
COMPARED = 200  # lines of them
SHOWN = 40  # names in a message
COMMENTS = ("#", "%", "//")
MISSING = ["", "-", "--", "na", "n/a", "null", "none", "N.A."]
_UNIT = re.compile(r"(?P<name>.*?)\s*(?:[\[(]|\s/\s|\sin\s)\s*(?P<unit>[^\])]*?)\s*[\])]?")


@dataclass(frozen=True)
class Log:
    """What a file holds.

    Attributes
    ----------
    names : tuple of str
    read : callable
        ``read(names, rows)``: columns (N,) by name, NaN where a value is missing. It raises a
        LogError for a column that does not hold numbers.
    units : dict of str to str
        Units that the file states, by column.
    """

    names: tuple[str, ...]
    read: Callable[[list[str], slice], dict[str, Array]]
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def listed(self) -> str:
        """The names for a message, the first forty of very many."""
        more = len(self.names) - SHOWN
        return ", ".join(self.names[:SHOWN]) + f" and {more} more" * (more > 0)

    def lacks(self, name: str, signal: str = "") -> str:
        """Return the message for a column that does not exist; digits of a name are a joint's."""
        digits = re.findall(r"\d+", name)
        alike = [known for known in self.names if re.findall(r"\d+", known) == digits]
        hint = did_you_mean(name, alike)
        return f"there is no column {name!r}{signal}.{hint} There are {self.listed}"


def open_log(path: Path, header: int | None = None) -> Log:
    """Open a log.

    Parameters
    ----------
    path : Path
        CSV (``,``, ``;``, tab or blanks between the columns, decimal points or commas, UTF-8,
        UTF-16 or Latin-1), MAT or HDF5, and so NetCDF-4. Matrices give a column ``name[i]`` each,
        structures and groups ``outer.inner``.
    header : int, optional
        Line of the names in a CSV, from 1; by default the content shows it.

    Raises
    ------
    LogError
        If the file cannot be read, or holds no columns of numbers.
    """
    try:
        if path.stat().st_size > LARGEST:
            raise LogError(f"{path}: is larger than {LARGEST / 1e9:.0f} GB; give a part of it")
        with path.open("rb") as file:
            start = file.read(PROBE)
        if b"\x89HDF" in (start[:4], start[512:516]):
            import h5py

            with h5py.File(path) as content:
                columns = dict(_flattened(content))
        elif start.startswith(b"MATLAB"):
            columns = dict(_flattened(loadmat(path, simplify_cells=True)))
        else:
            return _csv(path, start, header)
    except (LogError, MemoryError):
        raise
    except Exception as error:  # scipy and h5py raise whatever damaged bytes lead to
        reason = getattr(error, "strerror", None) or f"{error}; is it damaged?"
        raise LogError(f"{path}: cannot be read: {reason}") from error
    if not columns:
        raise LogError(f"{path}: holds no columns of numbers")
    return Log(tuple(columns), lambda n, rows: {k: columns[k][rows] for k in n})


def _flattened(content: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Array]]:
    """Yield the columns of nested structures; elements of an array of them by their own name."""
    for name, value in content.items():
        if name.startswith(("__", "#")):  # what scipy adds, and the inside of MATLAB's cells
            continue
        if isinstance(value, Mapping):
            yield from _flattened(value, f"{before}{name}.")
        elif isinstance(value, list) or getattr(value, "dtype", np.dtype(float)).kind == "O":
            items = [item for item in value if isinstance(item, Mapping)]
            own = [item.get("Name") or item.get("label") or i for i, item in enumerate(items, 1)]
            inner = {f"{name}.{key}": item for key, item in zip(own, items, strict=True)}
            yield from _flattened(inner, before)
        else:
            yield from _columns_of(before + name, np.squeeze(np.asarray(value)))


def _columns_of(name: str, array: NDArray[Any]) -> Iterator[tuple[str, Array]]:
    """Yield the columns that an array holds, the long side of a matrix as time; else none."""
    if array.dtype.kind not in "fiub" or array.dtype.names or array.size < 2:
        return
    if array.ndim == 1:
        yield name, array.astype(float)
    elif array.ndim == 2 and min(array.shape) <= WIDEST:
        columns = array.T if array.shape[0] >= array.shape[1] else array
        yield from ((f"{name}[{j}]", column.astype(float)) for j, column in enumerate(columns))


def _csv(path: Path, start: bytes, header: int | None) -> Log:
    encoding = _encoding(start)
    lines = start.decode(encoding, "replace").splitlines()
    lines = lines[:-1] if len(start) == PROBE else lines  # the last one may be cut off
    kept = [k for k, x in enumerate(lines) if x.strip() and not x.lstrip().startswith(COMMENTS)]
    kept = kept[:COMPARED]
    layouts = [(mark, point) for mark in ";\t,| " for point in ".," if mark != point]
    tried = [(*_tried([lines[k] for k in kept], *one), *one) for one in layouts] if kept else []
    share, width, row, separator, decimal = max(
        tried, key=lambda t: t[:2], default=(0.0, 0, 0, "", "")
    )
    if not share:
        raise LogError(
            f"{path}: neither MAT nor HDF5, and without the rows of numbers of a CSV: unpack or "
            "export it"
        )
    first = kept[row]
    head, below = _head(path, lines[:first], kept[:row], separator, width, header)
    names, units = names_and_units([*head, *[""] * width][:width])
    units |= {name: unit.strip("[]() ") for name, unit in zip(names, below, strict=False) if unit}

    def read(chosen: list[str], part: slice) -> dict[str, Array]:
        try:
            table = pd.read_csv(
                path, sep=r"\s+" if separator == " " else separator, decimal=decimal, names=names,
                usecols=chosen, header=None, skiprows=first, index_col=False, encoding=encoding,
                encoding_errors="replace", skipinitialspace=True, na_values=MISSING,
                comment=next((x[0] for x in lines if x.startswith(COMMENTS[:2])), None),
                low_memory=False,
            )[part]  # fmt: skip
        except (pd.errors.ParserError, ValueError) as error:
            raise LogError(
                f"{path}: {str(error).strip().splitlines()[-1]}; two logs in one file, or a "
                "separator inside a number?"
            ) from error
        whole = len(table) < 2 or table.iloc[-1].notna().all()
        table = table if whole else table[:-1]  # a line that was cut off as the log ended
        return {name: _numbers(path, name, table[name]) for name in chosen}

    return Log(tuple(names), read, units)


def _encoding(start: bytes) -> str:
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    try:
        start[: start.rfind(b"\n") + 1].decode()
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def _cells(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]


def _tried(lines: Sequence[str], separator: str, decimal: str) -> tuple[float, int, int]:
    """Return how well a layout cuts lines into numbers, the cells of a row, and the first row."""
    cells = [_cells(line, separator) for line in lines]
    width = Counter(map(len, cells)).most_common(1)[0][0]
    table = pd.DataFrame([(row + [""] * width)[:width] for row in cells])
    numbers = table.apply(lambda column: _parsed(column, decimal).notna())
    told = numbers[len(numbers) // 2 :].mean() > 0.5  # the columns of numbers, behind any head
    rows = (numbers | table.isin(MISSING)).loc[:, told].all(axis=1) & numbers.any(axis=1)
    first = int(np.argmax(rows))
    return (2 * told.mean() - 1) * rows[first:].mean(), width, first


def _parsed(texts: pd.Series[Any], decimal: str = ".") -> pd.Series[Any]:
    """Return texts as numbers, NaN where they are none; Fortran writes 1.0D-03."""
    texts = texts.str.replace(".", "?").str.replace(",", ".") if decimal == "," else texts
    return pd.to_numeric(texts.str.replace("[dD]", "e", regex=True), errors="coerce")


def _head(  # noqa: PLR0917
    path: Path,
    lines: Sequence[str],
    kept: Sequence[int],
    separator: str,
    width: int,
    header: int | None,
) -> tuple[list[str], list[str]]:
    """Return the cells of the names, and of a line of units below them if there is one.

    Of a block of lines directly above the rows, such as TwinCAT writes with the same key in front
    of every signal, the first has the names.
    """
    above = [_cells(line.lstrip("#%/ "), separator) for line in lines]
    if header is not None:
        return above[header - 1], []
    if not kept:  # numpy.savetxt writes them as a comment
        return next((row for row in reversed(above) if len(row) == width), []), []
    fits = [len(row) == width or (not any(row[width:]) and len(row) >= width - 1) for row in above]
    if not fits[kept[-1]]:
        raise LogError(
            f"{path}: the rows have {width} cells, but the line above them, line {kept[-1] + 1}, "
            f"has {len(above[kept[-1]])}: say which line has the names with --header LINE"
        )
    begin = max((k + 1 for k, good in enumerate(fits[: kept[-1]]) if not good), default=0)
    block = [above[k] for k in kept if k >= begin]
    if len(block) > 1 and any(is_unit(cell.strip("[]() ")) for cell in block[-1]):
        return block[-2], block[-1]
    keyed = len(block) > 2 and all(row.count(row[0]) > 1 for row in block)
    return block[0] if keyed else block[-1], []


def names_and_units(head: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Return the names of columns, each once, and the known units that follow them.

    Examples
    --------
    >>> names_and_units(["t [s]", "phi in deg", "phi in deg", "", "q[3]"])
    (['t', 'phi', 'phi#2', 'column4', 'q[3]'], {'t': 's', 'phi': 'deg', 'phi#2': 'deg'})
    """
    names, units, count = list[str](), dict[str, str](), Counter[str]()
    for place, text in enumerate(map(str.strip, head), 1):
        match = _UNIT.fullmatch(text)
        known = match is not None and is_unit(match["unit"])
        name = (match["name"] if match and known else text) or f"column{place}"
        count[name] += 1
        names.append(f"{name}#{count[name]}" if count[name] > 1 else name)
        if match and known:
            units[names[-1]] = match["unit"]
    return names, units


def _numbers(path: Path, name: str, column: pd.Series[Any]) -> Array:
    """Return a column as numbers; stamps of date and time as seconds from the first."""
    if pd.api.types.is_numeric_dtype(column):
        return column.to_numpy(float)
    texts = column.astype("string").str.strip()
    numbers = _parsed(texts)
    bad = (numbers.isna() & texts.notna()).to_numpy(bool)
    if not bad.any():
        return numbers.to_numpy(float)
    if ":" in str(texts.iloc[0]):
        stamps = pd.to_datetime(texts, format="mixed", utc=True, errors="coerce")
        if stamps.notna().all():
            return (stamps - stamps.iloc[0]).dt.total_seconds().to_numpy(float)
    row = column.index[np.argmax(bad)]
    raise LogError(
        f"{path}: row {row}, column {name}: {str(texts[row])[:60]!r} is not a number ({bad.sum()} "
        f"of {len(texts)} such cells); correct or empty them, as an empty cell is a gap, or, if a "
        f"new log begins there, take one part with --rows 0:{row}"
    )
