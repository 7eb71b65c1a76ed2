"""Logs as tables of text: CSV and what goes by that name."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading.csv_layout import (
    BLANKS,
    Layout,
    cells,
    is_number,
    layout_of,
    shortened,
)
from flexaxis.experiments.logs.reading.log import WIDEST, Array, Log

_FIELDS = re.compile(r"Expected (\d+) fields in line (\d+), saw (\d+)")
_MISSING = ["", "-", "--", "na", "none", "N.A."]


def open_file(path: Path) -> Log:
    """Open one; see `log.open_log`."""
    layout = layout_of(path)

    def read(names: Sequence[str], *, strict: bool = True) -> dict[str, Array]:
        table = _table(path, layout, names)
        found = {}
        for name in names:
            try:
                found[name] = _numbers(path, layout, name, table[name])
            except LogError:
                if strict:
                    raise
        return found

    return Log(path.name, layout.names, read, layout.units)


def _table(path: Path, layout: Layout, chosen: Sequence[str]) -> Any:
    """Return some columns as a table of pandas, without a line that was cut off at the end."""
    try:
        import pandas
    except ImportError as error:
        raise LogError(f"{path}: reading CSV needs pandas: pip install pandas") from error
    # rows are checked for their number of cells only where all columns are read
    wide = len(layout.names) > WIDEST
    try:
        table = pandas.read_csv(
            path,
            sep=r"\s+" if layout.separator == BLANKS else layout.separator,
            decimal=layout.decimal,
            comment=layout.comment[0] if layout.comment else None,
            names=list(layout.names),
            usecols=[n for n in layout.names if n in chosen] if wide else None,
            header=None,
            skiprows=layout.first,
            encoding=layout.encoding,
            encoding_errors="replace",
            skipinitialspace=True,
            na_values=_MISSING,
            low_memory=False,
            **_to_the_last_digit(pandas.__version__),
        )
    except (pandas.errors.ParserError, pandas.errors.EmptyDataError, ValueError) as error:
        raise LogError(f"{path}: {_in_words(str(error), layout)}") from error
    table = table[list(dict.fromkeys(chosen))]
    if len(table) > 1 and table.iloc[-1].isna().any():
        table = table.iloc[:-1]  # a line that was cut off as the log ended
    return table


def _to_the_last_digit(version: str) -> dict[str, Any]:
    """Return what makes pandas read numbers as they were written: from 3.1 on it does by itself."""
    found = re.match(r"(\d+)\.(\d+)", version)
    old = found is not None and (int(found[1]), int(found[2])) < (3, 1)
    return {"float_precision": "round_trip"} if old else {}


def _in_words(text: str, layout: Layout) -> str:
    found = _FIELDS.search(text)
    if not found:
        return text.strip().splitlines()[-1]
    line, cells_there = int(found[2]), found[3]
    return (
        f"line {line} has {cells_there} cells, but there are {len(layout.names)} names; two logs "
        "in one file, or a separator inside a number?"
    )


def _numbers(path: Path, layout: Layout, name: str, column: Any) -> Array:
    """Return a column as numbers; stamps of date and time as seconds from the first."""
    import pandas

    if pandas.api.types.is_numeric_dtype(column):
        return column.to_numpy(float)
    texts = column.astype("string").str.strip()
    # Fortran writes 1.0D-03
    numbers = pandas.to_numeric(texts.str.replace("[dD]", "e", regex=True), errors="coerce")
    bad = numbers.isna() & texts.notna()
    if not bad.any():
        return numbers.to_numpy(float)
    stamps = _stamps(texts)
    if stamps is not None:
        return stamps
    place = int(np.argmax(bad.to_numpy(bool)))
    line = next((k for i, k in enumerate(_rows(path, layout)) if i == place), place)
    raise LogError(
        f"{path}: line {line}, column {name}: {shortened(str(texts.iloc[place]))!r} is not a "
        f"number ({int(bad.sum())} of {len(texts)} such cells); mend or empty them, an empty cell "
        "is a gap"
    )


def _stamps(texts: Any) -> Array | None:
    """Return stamps of date and time as seconds from the first; None if they are none."""
    import pandas

    if is_number(str(texts.iloc[0])) or not re.search(r"\d:\d", str(texts.iloc[0])):
        return None
    try:
        stamps = pandas.to_datetime(texts, format="ISO8601", utc=True)
    except ValueError:
        try:
            stamps = pandas.to_datetime(texts, format="mixed", utc=True)
        except ValueError:
            return None
    return np.asarray((stamps - stamps.iloc[0]).dt.total_seconds(), float)


def _rows(path: Path, layout: Layout) -> Iterator[int]:
    """Yield the lines of the rows, from 1."""
    with path.open(encoding=layout.encoding, errors="replace") as file:
        for number, line in enumerate(file, 1):
            if number <= layout.first or not line.strip():
                continue
            if layout.comment and line.startswith(layout.comment[0]):
                continue
            if cells(line, layout.separator):
                yield number
