"""The rows of a folder column by column, read from its files when they are asked for.

A few columns are in memory at a time: as many as take `ROOM`. Texts are numbers of texts.
"""

from __future__ import annotations

import json
import math
import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.running.columns import COLUMNS, KEY, axis_kind
from flexaxis.experiments.running.errors import StudyError
from flexaxis.experiments.running.store import CASE, STORED, TEXTS, connect, row_files, said
from flexaxis.experiments.scoring.score import Kind

PART = 1 << 14  # rows that are read at a time where all their columns are wanted
ROOM = 1 << 28  # bytes of columns in memory

Index = NDArray[np.signedinteger[Any]]
_TYPES: Mapping[str, Any] = {
    "text": np.int32, "number": np.float64, "integer": np.int64, "truth": np.int8
}  # fmt: skip
_NUMBERS = tuple(name for name in STORED if COLUMNS.get(name) == "number")


@dataclass(frozen=True, eq=False)
class _File:
    """A file of rows: those that were there when it was opened, and are in no file before."""

    path: Path
    db: sqlite3.Connection
    ids: NDArray[np.int32]  # what a text of the file is among those of the folder
    rows: NDArray[np.int64]  # their numbers in the file, in order

    def columns(self, names: Sequence[str], rows: NDArray[np.int64]) -> NDArray[Any]:
        """Return columns of some of its rows, as fields of an array."""
        fields = [(name, np.float64 if name in _NUMBERS else np.int64) for name in names]
        wanted = ", ".join(
            f'coalesce("{name}", {"9e999" if name in _NUMBERS else -1})' for name in names
        )
        query = f"SELECT rowid, {wanted} FROM cells WHERE rowid BETWEEN ? AND ? ORDER BY rowid"
        with said(self.path):
            lines = self.db.execute(query, (int(rows[0]), int(rows[-1])))
            try:
                found = np.fromiter(lines, [("rowid", np.int64), *fields])
            except (TypeError, ValueError, OverflowError) as error:
                raise StudyError(f"{self.path}: is damaged: {error}") from error
        if len(found) != len(rows):
            found = found[np.isin(found["rowid"], rows)]
        if len(found) != len(rows):
            raise StudyError(f"{self.path}: rows were removed while they were read: read it again")
        return found


@dataclass(frozen=True)
class Table:
    """The columns of a folder.

    Attributes
    ----------
    axes : tuple of str
        Swept keys; each is a column too.
    """

    axes: tuple[str, ...]
    _files: tuple[_File, ...] = field(repr=False)
    _texts: tuple[str, ...] = field(repr=False)
    _held: dict[str, Any] = field(default_factory=dict, repr=False)
    _seen: dict[str, tuple[Any, list[Any]]] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        """Return the number of rows."""
        return sum(len(file.rows) for file in self._files)

    @property
    def kinds(self) -> dict[str, Kind]:
        """The kind of each column, the axes last."""
        axes = {axis: axis_kind(v for v in self.texts(axis) if v is not None) for axis in self.axes}
        return {**COLUMNS, **axes}

    @cached_property
    def order(self) -> NDArray[np.int32]:
        """The rows in the order of seeds, and of one seed in that of the cases."""
        return np.lexsort((self.raw(CASE), self.raw("seed"))).astype(np.int32)

    def raw(self, column: str, rows: Index | None = None) -> NDArray[Any]:
        """Return a column as it is stored: numbers of texts, −1 for what is not defined.

        Parameters
        ----------
        column : str
        rows : ndarray of int, optional
            Which, in increasing order; all by default.
        """
        stored = "axes" if column in self.axes else column
        if rows is None or stored in self._held or (rows.size and rows[-1] - rows[0] > 2 * PART):
            whole = self._whole(stored)
            found = whole if rows is None else whole[rows]
        elif not rows.size:
            found = np.empty(0, np.int64)
        else:
            found = self._near(stored, int(rows[0]), int(rows[-1]) + 1)[rows - rows[0]]
        return self._codes(column)[found] if self.coded(column) else found

    def _whole(self, stored: str) -> NDArray[Any]:
        """Return all of a column; some others are read with it, which are likely to come next."""
        if stored not in self._held:
            room = max(1, ROOM // (8 * max(1, len(self))))
            place = STORED.index(stored)
            names = [n for n in STORED[place : place + room] if n not in self._held]
            while self._held and len(self._held) + len(names) > 2 * room:
                del self._held[next(iter(self._held))]
            parts = [
                (file, file.columns(names, file.rows)) for file in self._files if len(file.rows)
            ]
            for name in names:
                each = [_typed(name, found[name], file) for file, found in parts]
                self._held[name] = np.concatenate(each) if each else np.empty(0, _type(name))
        return np.asarray(self._held[stored])

    def _near(self, stored: str, start: int, stop: int) -> NDArray[Any]:
        """Return a part of a column; all columns of the part are kept until another is read."""
        held = self._seen.get(_PLACE)
        if held is None or held[0] != (start, stop):
            pieces, first = [], 0
            for file in self._files:
                rows = file.rows[max(0, start - first) : max(0, stop - first)]
                if len(rows):
                    pieces.append((file, file.columns(STORED, rows)))
                first += len(file.rows)
            held = self._seen[_PLACE] = (start, stop), pieces
        return np.concatenate([_typed(stored, found[stored], file) for file, found in held[1]])

    def texts(self, column: str) -> list[Any]:
        """Return the values of a column of texts, or of an axis, by their number."""
        self._codes(column)
        return self._seen[column][1]

    def _codes(self, column: str) -> NDArray[np.int32]:
        """Return the number among the values of a column of each text of the folder; −1 last."""
        if column not in self._seen:
            axis = column in self.axes
            there = np.zeros(len(self._texts) + 1, bool)
            there[self._whole("axes" if axis else column)] = True
            codes, values = np.full(len(there), -1, np.int32), dict[str, int]()
            for number in np.flatnonzero(there[:-1]).tolist():
                value = self._texts[number]
                if axis:
                    value = json.dumps(self._axes(value).get(column))
                if not (axis and value == "null"):
                    codes[number] = values.setdefault(value, len(values))
            known = [json.loads(v) for v in values] if axis else list(values)
            self._seen[column] = codes, known
        codes = self._seen[column][0]
        return codes

    def _axes(self, text: str) -> dict[str, Any]:
        try:
            return dict(json.loads(text))
        except (ValueError, TypeError) as error:
            where = self._files[0].path
            raise StudyError(f"{where}: is damaged: axes are {text[:40]!r}") from error

    def numbers(self, column: str, rows: Index | None = None) -> NDArray[np.float64]:
        """Return a column of numbers or truths (n,); NaN where it is not defined."""
        found = self.raw(column, rows)
        if self.coded(column):
            values = np.array([*self.texts(column), None], float)
            return np.asarray(values[found])
        if found.dtype == np.float64:
            return found
        return np.where(found < 0, np.nan, found)

    def values(self, column: str, rows: Index | None = None) -> list[Any]:
        """Return a column as Python values; None where it is not defined."""
        found = self.raw(column, rows)
        if column == CASE:
            return [f"{case:016x}" for case in found.tolist()]
        if self.coded(column):
            texts = [*self.texts(column), None]
            return [texts[i] for i in found.tolist()]
        if found.dtype == np.float64:
            return [None if math.isnan(v) else v for v in found.tolist()]
        if found.dtype == np.int8:
            return [None if v < 0 else v > 0 for v in found.tolist()]
        return [None if v < 0 else v for v in found.tolist()]

    def among(self, column: str, values: Sequence[Any]) -> NDArray[np.bool_]:
        """Return in which rows (n,) a column has one of some values, None among them."""
        if self.coded(column):
            codes = [code for code, value in enumerate(self.texts(column)) if value in values]
            return np.isin(self.raw(column), [*codes, -1] if None in values else codes)
        if column == CASE:
            return np.isin(self.raw(CASE), np.array([int(v, 16) for v in values], np.uint64))
        numbers = self.numbers(column)
        found = np.isin(numbers, [float(v) for v in values if v is not None])
        return found | np.isnan(numbers) if None in values else found

    def coded(self, column: str) -> bool:
        """Whether a column is stored as numbers of texts."""
        return column in self.axes or column in TEXTS


_PLACE = ""  # among what was seen: the rows that were read last, with all columns


def _type(name: str) -> Any:
    return np.uint64 if name == CASE else _TYPES[COLUMNS.get(name, "text")]


def _typed(name: str, found: NDArray[Any], file: _File) -> NDArray[Any]:
    """Return a column of a file as it is among those of the folder."""
    if name == CASE:
        return np.ascontiguousarray(found).view(np.uint64)
    if name in TEXTS:
        if found.size and found.max() >= len(file.ids):
            raise StudyError(f"{file.path}: is damaged: a text of {name} is missing")
        return file.ids[found]
    if name in _NUMBERS:
        return np.where(np.isinf(found), np.nan, found)
    return found.astype(_type(name))


def open_table(folder: Path, axes: Sequence[str]) -> Table:
    """Return the columns of the rows in a folder.

    Parameters
    ----------
    folder : Path
    axes : sequence of str
        Swept keys.

    Raises
    ------
    StudyError
        If a file is damaged.
    """
    known: dict[str, int] = {}
    files = [_opened(path, known) for path in row_files(folder)]
    table = Table(tuple(axes), tuple(files), tuple(known))
    if len(files) < 2:
        return table
    once = np.zeros(len(table), bool)  # shares that overlap have the same rows
    keys = np.stack([table._whole(name) for name in KEY])
    once[np.unique(keys, axis=1, return_index=True)[1]] = True
    ends = np.cumsum([len(file.rows) for file in files])[:-1]
    kept = [
        _File(file.path, file.db, file.ids, file.rows[mine])
        for file, mine in zip(files, np.split(once, ends), strict=True)
    ]
    return Table(tuple(axes), tuple(kept), tuple(known))


def asked_of(table: Table, study: Mapping[str, Any]) -> NDArray[np.bool_]:
    """Return which rows of a table are of what study.json says was asked for last (n,).

    Of a comparison, and in folders of 0.1, that are all; of code of users those of the code then.
    """
    asked, found = study.get("asked") or {}, np.ones(len(table), bool)
    if not asked.get("estimators"):
        return found
    for column, key in (("hash", "hashes"), ("method", "estimators"), ("seed", "seeds")):
        if key in asked:
            found &= table.among(column, asked[key])
    for text, code in study.get("code", {}).items():
        found &= ~(table.among("method", [text]) & ~table.among("code", [code]))
    return found


def _opened(path: Path, known: dict[str, int]) -> _File:
    with said(path):
        db = connect(path)
        texts = list(db.execute("SELECT id, text FROM texts ORDER BY id"))
        rows = np.fromiter((row for (row,) in db.execute("SELECT rowid FROM cells")), np.int64)
        rows.sort()
    ids = np.full(max((number for number, _ in texts), default=0) + 2, -1, np.int32)
    for number, text in texts:
        if text is not None:
            ids[number] = known.setdefault(text, len(known))
    return _File(path, db, ids, rows)
