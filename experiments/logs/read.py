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

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.units import is_unit
from flexaxis.sim.errors import did_you_mean

Array = NDArray[np.float64]

WIDEST = 64  # columns that a matrix may have, so that a picture is not taken for signals
LARGEST = 8_000_000_000  # bytes of a file
PROBE = 1 << 17  # bytes at the beginning, by which the layout is found
ROWS = 60  # lines that are compared
SHOWN = 40  # names in a message
COMMENTS = ("#", "%", "//")
MISSING = ["", "-", "--", "na", "n/a", "null", "none", "N.A."]
_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eEdD][-+]?\d+)?|[-+]?(nan|inf|infinity)", re.I)
_UNIT = re.compile(r"(?P<name>.*?)\s*(?:[\[(]\s*(.*?)\s*[\])]|\s/\s(\S+)|\sin\s(\S+))")


@dataclass(frozen=True)
class Log:
    """What a file holds.

    Attributes
    ----------
    source : str
        File name, for messages.
    names : tuple of str
    read : callable
        ``read(names, rows)``: columns (N,) by name, NaN where a value is missing; use `load`.
    units : dict of str to str
        Units that the file states, by column.
    """

    source: str
    names: tuple[str, ...]
    read: Callable[[list[str], slice], Mapping[str, Array]]
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def listed(self) -> str:
        """The names for a message, the first forty of very many."""
        more = len(self.names) - SHOWN
        return ", ".join(self.names[:SHOWN]) + f" and {more} more" * (more > 0)

    def load(self, names: Sequence[str], rows: slice = slice(None)) -> dict[str, Array]:
        """Return some rows of some columns.

        Raises
        ------
        LogError
            If a column does not hold numbers.
        """
        return dict(self.read(list(dict.fromkeys(names)), rows))

    def lacks(self, name: str, signal: str = "") -> str:
        """Return the message for a column that does not exist; digits of a name are a joint's."""
        alike = [known for known in self.names if _digits(known) == _digits(name)]
        hint = did_you_mean(name, alike)
        return f"there is no column {name!r}{signal}.{hint} There are {self.listed}"


def _digits(name: str) -> list[str]:
    return re.findall(r"\d+", name)


def open_log(path: Path, header: int | None = None) -> Log:
    """Open a log.

    Parameters
    ----------
    path : Path
        CSV (``,``, ``;``, tab or blanks between the columns, decimal points or commas, UTF-8,
        UTF-16 or Latin-1), MAT or HDF5, and so NetCDF-4. Matrices give a column ``name[i]`` each,
        structures and groups ``outer.inner``.
    header : int, optional
        Line of the names in a CSV, from 1; found by content by default.

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
            columns = _hdf5(path)
        elif start.startswith(b"MATLAB"):
            columns = _mat(path)
        else:
            return _csv(path, start, header)
    except (LogError, MemoryError):
        raise
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror or error}") from error
    except Exception as error:  # scipy and h5py raise whatever damaged bytes lead to
        raise LogError(f"{path}: cannot be read, or is damaged: {error}") from error
    if not columns:
        raise LogError(f"{path}: holds no columns of numbers")
    return Log(path.name, tuple(columns), lambda n, rows: {k: columns[k][rows] for k in n})


def _mat(path: Path) -> dict[str, Array]:
    from scipy.io import loadmat

    content = loadmat(path, simplify_cells=True)
    return dict(_flattened({n: v for n, v in content.items() if not n.startswith("__")}))


def _flattened(content: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Array]]:
    """Yield the columns of nested structures; elements of an array of them by their own name."""
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from _flattened(value, f"{before}{name}.")
        elif isinstance(value, list) or getattr(value, "dtype", np.dtype(float)).kind == "O":
            items = [item for item in value if isinstance(item, Mapping)]
            own = [item.get("Name") or item.get("label") or i for i, item in enumerate(items, 1)]
            inner = {f"{name}.{key}": item for key, item in zip(own, items, strict=True)}
            yield from _flattened(inner, before)
        else:
            yield from columns_of(before + name, value)


def _hdf5(path: Path) -> dict[str, Array]:
    import h5py

    columns: dict[str, Array] = {}

    def visit(place: str, item: Any) -> None:
        # "#refs#" is where MATLAB keeps the inside of cells
        if isinstance(item, h5py.Dataset) and not place.startswith("#"):
            columns.update(columns_of(place.replace("/", "."), item[()]))

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return columns


def columns_of(name: str, array: Any) -> Iterator[tuple[str, Array]]:
    """Yield the columns that an array holds, the long side of a matrix as time; else none."""
    array = np.squeeze(np.asarray(array))
    if array.dtype.kind not in "fiub" or array.dtype.names or array.size < 2:
        return
    if array.ndim == 1:
        yield name, array.astype(float)
    elif array.ndim == 2 and min(array.shape) <= WIDEST:
        tall = array if array.shape[0] >= array.shape[1] else array.T
        yield from ((f"{name}[{j}]", column.astype(float)) for j, column in enumerate(tall.T))


def _csv(path: Path, start: bytes, header: int | None) -> Log:
    encoding = _encoding(start)
    lines = codecs.getincrementaldecoder(encoding)("replace").decode(start).splitlines()
    lines = lines[:-1] if len(start) == PROBE else lines  # the last one may be cut off
    kept = {k: x for k, x in enumerate(lines) if x.strip() and not x.lstrip().startswith(COMMENTS)}
    every = [(mark, point) for mark in ";\t,| " for point in ".," if mark != point]
    (share, width), separator, decimal = max(
        ((_score([*kept.values()], *one), *one) for one in every), key=lambda layout: layout[0]
    )
    if not share:
        raise LogError(
            f"{path}: neither MAT nor HDF5, and without the rows of numbers of a CSV: unpack or "
            "export it"
        )
    rows = {k: _cells(line, separator, decimal) for k, line in kept.items()}
    # a line of a head may look like a row, but has its texts elsewhere
    texts = {k: tuple(map(_is_text, row)) for k, row in rows.items() if len(row) == width}
    usual = Counter(texts[k] for k in texts if _is_row(rows[k])).most_common(1)[0][0]
    first = next(k for k, own in texts.items() if own == usual)
    if header is not None:
        head, below = _cells(lines[header - 1].lstrip("#%/ "), separator), []  # type: ignore[var-annotated]
    else:
        noted = [x.lstrip("#%/ ") for k, x in enumerate(lines[:first]) if k not in kept]
        above = {k: row for k, row in rows.items() if k < first}
        head, below = _head(path, above, [_cells(x, separator) for x in noted], width)
    names, units = names_and_units([*head, *[""] * width][:width])
    units |= {name: unit.strip("[]() ") for name, unit in zip(names, below, strict=False) if unit}
    comment = next((x[0] for x in lines if x.startswith(COMMENTS[:2])), None)
    layout = {
        "sep": r"\s+" if separator == " " else separator,
        "decimal": decimal,
        "skiprows": first,
        "encoding": encoding,
        "comment": comment,
    }

    def read(chosen: list[str], part: slice) -> dict[str, Array]:
        table = _table(path, layout, names).iloc[part]
        whole = len(table) < 2 or table[chosen].iloc[-1].notna().all()
        table = table if whole else table[:-1]  # a line that was cut off as the log ended
        return {name: _numbers(path, name, table[name]) for name in chosen}

    return Log(path.name, tuple(names), read, units)


def _encoding(start: bytes) -> str:
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(start)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def _cells(line: str, separator: str, decimal: str = ".") -> list[str]:
    """Return the cells of a line, with decimal points."""
    row = line.split() if separator == " " else next(csv.reader([line], delimiter=separator))
    row = [cell.strip() for cell in row]
    return (
        [c.replace(",", ".") if "." not in c else f"{c}?" for c in row] if decimal == "," else row
    )


def _is_row(row: Sequence[str]) -> bool:
    """Whether a line can be one of numbers: a text or a missing value here and there is none."""
    return any(map(_NUMBER.fullmatch, row)) and sum(map(_is_text, row)) <= len(row) / 2


def _is_text(text: str) -> bool:
    return not _NUMBER.fullmatch(text) and text.lower() not in MISSING


def _score(lines: Sequence[str], separator: str, decimal: str) -> tuple[float, int]:
    """Return the share of numbers among the cells, and the usual number of cells of a row."""
    split = [_cells(line, separator, decimal) for line in lines[:ROWS]]
    start = next((k for k, row in enumerate(split) if _is_row(row)), None)
    if start is None:
        return 0.0, 0
    rows = [row for row in split[start:] if _is_row(row)]
    width = Counter(map(len, rows)).most_common(1)[0][0]
    numbers = sum(not _is_text(cell) for row in rows if len(row) == width for cell in row)
    # a layout by which other lines fall out explains less
    return round(numbers / (width * len(split[start:])), 6), width


def _head(
    path: Path, above: dict[int, list[str]], noted: list[list[str]], width: int
) -> tuple[list[str], list[str]]:
    """Return the line of names, and one of units below it if there is one.

    Of a block of lines directly above the rows, such as TwinCAT writes with the same key in front
    of every signal, the first has the names.
    """
    if not above:  # numpy.savetxt writes them as a comment
        return next((row for row in noted[::-1] if len(row) == width), []), []
    block, last = list[list[str]](), max(above)
    number = last
    while number in above:
        row = above[number]
        while len(row) > width and not row[-1]:  # a separator at the end of the line
            row.pop()
        if len(row) not in (width, width - 1):
            break
        block.insert(0, row)
        number -= 1
    if not block:
        raise LogError(
            f"{path}: the rows have {width} cells, but the line above them, line {last + 1}, has "
            f"{len(above[last])}: say which line has the names with --header LINE"
        )
    if len(block) == 2 and _are_units(block[1]):
        return block[0], block[1]
    keyed = len(block) > 2 and all(row.count(row[0]) > 1 for row in block)
    return block[0] if keyed else block[-1], []


def _are_units(row: Sequence[str]) -> bool:
    """Whether a line can be one of units: short words, or words in brackets."""
    return all(len(c) <= 12 and " " not in c and not _NUMBER.fullmatch(c) for c in row)


def names_and_units(head: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Return the names of columns, each once, and the known units that follow them.

    Examples
    --------
    >>> names_and_units(["t [s]", "phi in deg", "phi in deg", "", "q[3]"])
    (['t', 'phi', 'phi#2', 'column4', 'q[3]'], {'t': 's', 'phi': 'deg', 'phi#2': 'deg'})
    """
    names: list[str] = []
    units: dict[str, str] = {}
    for place, text in enumerate(map(str.strip, head), 1):
        match = _UNIT.fullmatch(text)
        unit = next(filter(None, match.groups()[1:]), "") if match else ""
        plain = (match["name"] if match and is_unit(unit) else text) or f"column{place}"
        count = sum(name.partition("#")[0] == plain for name in names)
        name = f"{plain}#{count + 1}" if count else plain
        names.append(name)
        if is_unit(unit):
            units[name] = unit
    return names, units


def _table(path: Path, layout: Mapping[str, Any], names: list[str]) -> pd.DataFrame:
    """Return the rows without empty lines and comments; the index counts lines of the file."""
    try:
        table = pd.read_csv(
            path, **layout, names=names, header=None, index_col=False, skip_blank_lines=False,
            encoding_errors="replace", skipinitialspace=True, na_values=MISSING,
            low_memory=False,
        )  # fmt: skip
    except (pd.errors.ParserError, ValueError) as error:
        raise LogError(
            f"{path}: {str(error).strip().splitlines()[-1]}; two logs in one file, or a separator "
            "inside a number?"
        ) from error
    table.index += layout["skiprows"] + 1
    table = table.dropna(how="all")
    first = table[names[0]]
    if pd.api.types.is_numeric_dtype(first):
        return table
    return table[~first.map(str).str.startswith("//")]


def _numbers(path: Path, name: str, column: pd.Series[Any]) -> Array:
    """Return a column as numbers; stamps of date and time as seconds from the first."""
    if pd.api.types.is_numeric_dtype(column):
        return column.to_numpy(float)
    texts = column.astype("string").str.strip()
    # Fortran writes 1.0D-03
    numbers = pd.to_numeric(texts.str.replace("[dD]", "e", regex=True), errors="coerce")
    bad = numbers.isna() & texts.notna()
    if bad.any() and re.search(r"\d:\d", str(texts.iloc[0])):
        try:
            stamps = pd.to_datetime(texts, format="mixed", utc=True)
            return (stamps - stamps.iloc[0]).dt.total_seconds().to_numpy(float)
        except ValueError:
            pass
    if bad.any():
        place = int(np.argmax(bad.to_numpy(bool)))
        text = str(texts.iloc[place])
        again = f" or, if a new log begins there, take one part with --rows 0:{place}"
        raise LogError(
            f"{path}: line {column.index[place]}, column {name}: {text[:60]!r} is not a number "
            f"({int(bad.sum())} of {len(texts)} such cells); correct or empty them, as an empty "
            f"cell is a gap,{again}"
        )
    return numbers.to_numpy(float)
