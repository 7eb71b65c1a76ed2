"""How a table of text is laid out: encoding, separator, decimal mark, names, units, first row."""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from flexaxis.experiments.logs.errors import LogError

PROBE = 1 << 16  # bytes at the beginning by which a layout is told
MOST = 1 << 26  # bytes that twenty lines may have
LONGEST_LINE = 1 << 18  # characters, of the first lines: a thousand columns have a tenth of that
ROWS = 20  # lines of numbers that are looked at
COMMENTS = ("#", "%", "//")
BLANKS = " "
_SEPARATORS = (";", "\t", ",", "|", BLANKS)
_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eEdD][-+]?\d+)?|[-+]?(nan|inf|infinity)", re.I)
_MISSING = {"", "na", "n/a", "null", "none", "-", "--"}

# "pos [deg]", "pos (deg)", "pos / deg", "pos in deg"
_UNIT = re.compile(
    r"^\s*(?P<name>.*?)\s*(?:[\[(]\s*(?P<a>[^\])]*?)\s*[\])]|\s/\s(?P<b>\S+)|\sin\s(?P<c>\S+))\s*$"
)


@dataclass(frozen=True)
class Layout:
    """How a table is laid out.

    Attributes
    ----------
    encoding : str
    separator : str
        A blank for any number of blanks.
    decimal : str
        ``"."`` or ``","``.
    names : tuple of str
    units : dict of str to str
    first : int
        Line of the first row, from 0.
    comment : str or None
        What a line begins with that is none.
    """

    encoding: str
    separator: str
    decimal: str
    names: tuple[str, ...]
    units: dict[str, str]
    first: int
    comment: str | None


def layout_of(path: Path) -> Layout:
    """Find out how a table is laid out from its beginning.

    The separator and decimal mark are those by which most of the cells are numbers; the names
    stand over the first row of numbers, and units in brackets behind them or in a line between.
    A table without names has columns ``column1``, ``column2``, ….

    Raises
    ------
    LogError
        If there are no rows of numbers.
    """
    encoding, lines = _beginning(path)
    kept = [(k, line) for k, line in enumerate(lines) if line.strip() and not _is_comment(line)]
    best = max(
        ((*_score([line for _, line in kept], mark, point), mark, point)
         for mark in _SEPARATORS for point in ".," if mark != point),
        key=lambda found: found[:2],
    )  # fmt: skip
    share, width, separator, decimal = best
    if not share:
        raise LogError(
            f"{path}: holds no rows of numbers; a CSV needs a line of names and lines of numbers"
        )
    rows = [(k, cells(line, separator, decimal)) for k, line in kept]
    start = next(i for i, (_, row) in enumerate(rows) if _is_row(row) and len(row) == width)
    first = rows[start][0]
    head = max((i for i, (_, row) in enumerate(rows[:start]) if not _is_row(row)), default=-1)
    if head + 1 < start:
        number, row = rows[head + 1]
        raise LogError(
            f"{path}: line {number + 1} has {len(row)} cells, but most have {width}: decimal "
            "commas between commas? Write it with points, or with semicolons between the columns"
        )
    names, units = _head(path, [row for _, row in rows[:start]], lines[:first], width, separator)
    comment = next((mark for mark in COMMENTS for line in lines if line.startswith(mark)), None)
    return Layout(encoding, separator, decimal, tuple(names), units, first, comment)


def cells(line: str, separator: str, decimal: str = ".") -> list[str]:
    """Return the cells of a line, with decimal points."""
    if separator == BLANKS:
        row = line.split()
    else:
        try:
            row = next(csv.reader([line], delimiter=separator))
        except csv.Error:  # a cell beyond all measure
            row = line.split(separator)
        row = [cell.strip() for cell in row]
    if decimal == ",":
        row = [cell.replace(",", ".") if "." not in cell else cell + "?" for cell in row]
    return row


def _beginning(path: Path) -> tuple[str, list[str]]:
    """Return the encoding, and lines enough to see twenty rows."""
    size = PROBE
    while True:
        with path.open("rb") as file:
            start = file.read(size)
            whole = not file.read(1)
        encoding = _encoding(start)
        text = codecs.getincrementaldecoder(encoding)("replace").decode(start)
        lines = text.splitlines()
        longest = max(map(len, lines), default=0)
        if longest > LONGEST_LINE:
            raise LogError(
                f"{path}: one of its first lines has more than {LONGEST_LINE} characters, as no "
                "table of signals has: is it transposed, or without line breaks?"
            )
        if whole or len(lines) > 2 * ROWS or size > MOST:
            # the last one may be cut off
            return encoding, lines if whole else lines[:-1]
        size *= 8


def _encoding(start: bytes) -> str:
    for mark, name in (
        (codecs.BOM_UTF8, "utf-8-sig"),
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
    ):
        if start.startswith(mark):
            return name
    if b"\0" in start:
        return "utf-16-le" if start[1::2].count(0) > start[::2].count(0) else "utf-16-be"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(start)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(COMMENTS)


def _is_row(row: Sequence[str]) -> bool:
    """Whether a line can be one of numbers: a text or a missing value here and there is none."""
    return any(map(is_number, row)) and sum(map(_is_text, row)) <= len(row) / 2


def is_number(text: str) -> bool:
    """Whether a cell holds a number."""
    return _NUMBER.fullmatch(text) is not None


def _is_text(text: str) -> bool:
    return not is_number(text) and text.lower() not in _MISSING


def _score(lines: Sequence[str], separator: str, decimal: str) -> tuple[float, int]:
    """Return the share of numbers among the cells, and the usual number of cells of a row."""
    split = [cells(line, separator, decimal) for line in lines[: 3 * ROWS]]
    start = next((k for k, row in enumerate(split) if _is_row(row)), None)
    if start is None:
        return 0.0, 0
    below = split[start:]
    rows = [row for row in below if _is_row(row)]
    width = Counter(map(len, rows)).most_common(1)[0][0]
    numbers = sum(not _is_text(cell) for row in rows if len(row) == width for cell in row)
    # a layout by which other lines fall out explains less
    return round(numbers / (width * len(below)), 6), width


def _head(
    path: Path, above: list[list[str]], lines: list[str], width: int, separator: str
) -> tuple[list[str], dict[str, str]]:
    """Return names and units from the lines above the first row."""
    if not above:  # numpy.savetxt writes them as a comment
        noted = [cells(line.lstrip("#%/ "), separator) for line in lines if _is_comment(line)]
        above = [row for row in noted if len(row) == width][-1:]
    if not above:
        return names_and_units([""] * width)
    last = above[-1]
    second = len(above) > 1 and len(above[-2]) == width and _are_units(last)
    head = above[-2] if second else last
    while len(head) > width and not head[-1]:  # a separator at the end of the line
        head = head[:-1]
    if len(head) != width and not (len(head) == width - 1):
        raise LogError(
            f"{path}: the line of names has {len(head)} cells, but the rows have {width}: "
            f"{shortened(separator.join(head))}"
        )
    names, units = names_and_units([*head, ""][:width])
    if second:
        stated = (unit.strip("[]() ") for unit in last)
        units |= {name: unit for name, unit in zip(names, stated, strict=False) if unit}
    return names, units


def _are_units(row: Sequence[str]) -> bool:
    """Whether a line can be one of units: short words, or words in brackets."""
    return all(len(cell) <= 12 and " " not in cell.strip() for cell in row) and not any(
        map(is_number, row)
    )


def shortened(text: str) -> str:
    """Return a text for a message."""
    return text if len(text) <= 60 else text[:57] + "…"


def names_and_units(head: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Return the names of columns, each once, and the units that stand in brackets behind them.

    Examples
    --------
    >>> names_and_units(["t [s]", "phi in deg", "phi in deg", "", "i"])
    (['t', 'phi', 'phi#2', 'column4', 'i'], {'t': 's', 'phi': 'deg', 'phi#2': 'deg'})
    """
    names: list[str] = []
    units: dict[str, str] = {}
    for place, text in enumerate(head, 1):
        found = _UNIT.match(text)
        plain = (found["name"] if found else text).strip() or f"column{place}"
        name, count = plain, 1
        while name in names:
            count += 1
            name = f"{plain}#{count}"
        names.append(name)
        unit = (found["a"] or found["b"] or found["c"]) if found else None
        if unit:
            units[name] = unit
    return names, units
