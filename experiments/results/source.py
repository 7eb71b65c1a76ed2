"""The rows of a folder as they were when it was opened, asked for in SQL."""

from __future__ import annotations

import json
import math
import shutil
import tempfile
import weakref
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.storage.files import StudyError
from flexaxis.experiments.storage.schema import (
    CASE,
    COLUMNS,
    STORED,
    TEXTS,
    connect,
    of_axis,
    row_files,
    said,
    shown,
)
from flexaxis.experiments.storage.store import Store

Array = NDArray[Any]
ROOM = 1 << 29  # bytes of columns that are read together
PART = 1 << 14  # rows that are read at a time where all their columns are wanted


class Condition(NamedTuple):
    """What is true of rows, in SQL, and what its question marks stand for."""

    sql: str
    given: tuple[Any, ...] = ()

    def __and__(self, other: Condition) -> Condition:
        """Return that both are."""
        both = [each.sql for each in (self, other) if each != ALL]
        return Condition(" AND ".join(both) or ALL.sql, self.given + other.given)


ALL = Condition("1")
"""What is true of all rows."""


def having(column: str, values: Sequence[Any], axes: Sequence[str]) -> Condition:
    """Return that a column, or an axis, has one of some values, None among them."""
    given = (json.dumps([value for value in values if value is not None]),)

    def among(what: str) -> str:
        none = f" OR {what} IS NULL" if None in values else ""
        return f"({what} IN (SELECT value FROM json_each(?)){none})"

    if column in axes:
        found = f"id IN (SELECT axes FROM cells) AND {among(of_axis(column, 'text'))}"
        return Condition(f"cells.axes IN (SELECT id FROM texts WHERE {found})", given)
    if column in TEXTS:
        found = f"(SELECT id FROM texts WHERE {among('text')})"
        return Condition(f'cells."{column}" IN {found}', given)
    return Condition(among(shown(column)), given)


def asked(study: Mapping[str, Any]) -> Condition:
    """Return that rows are of what study.json says was asked for last.

    Without that, and of a comparison, it is all rows; of user code, those of the code then.
    """
    wanted, found = study.get("asked", {}), ALL
    if not wanted.get("estimators"):
        return found
    for column, key in (("hash", "hashes"), ("method", "estimators"), ("seed", "seeds")):
        found &= having(column, wanted[key], ())
    for text, code in study.get("code", {}).items():
        other, mine = having("method", [text], ()), having("code", [code], ())
        found &= Condition(f"(NOT {other.sql} OR {mine.sql})", other.given + mine.given)
    return found


class Source:
    """The rows of a folder: those that were there when it was opened, each once.

    Several files, as of shares, are put together in one of their own first.

    Raises
    ------
    StudyError, OutputError
        If a file is damaged, or cannot be read.
    """

    def __init__(self, folder: Path) -> None:
        files = row_files(folder)
        self._path = files[0] if len(files) == 1 else folder
        with said(self._path):
            if len(files) == 1:
                self._db = connect(files[0])
            else:  # shares that overlap have the same rows
                home = tempfile.mkdtemp(prefix="flexaxis-")
                weakref.finalize(self, shutil.rmtree, home, ignore_errors=True)
                store = Store(Path(home) / "scores.sqlite")
                for file in files:
                    store.take(file)
                self._db = store.db
            self._last = self._db.execute("SELECT max(rowid) FROM cells").fetchone()[0] or 0
            self.texts: dict[int, str | None] = dict(self._db.execute("SELECT id, text FROM texts"))
            self._seen, self._rows = -1, self._count()
            self._held = dict[str, Array]()
            self._axes = dict[str | None, dict[str, Any]]()

    def __len__(self) -> int:
        """Return the number of rows."""
        return self._rows

    def _count(self) -> int:
        count: int = self._db.execute(
            "SELECT count(*) FROM cells WHERE rowid <= ?", (self._last,)
        ).fetchone()[0]
        return count

    def lines(self, wanted: Sequence[str], where: Condition) -> Iterator[tuple[Any, ...]]:
        """Yield what is wanted of rows, in the order in which they came."""
        with said(self._path):
            (version,) = self._db.execute("PRAGMA data_version").fetchone()
            if version != self._seen and self._count() != self._rows:
                raise StudyError(
                    f"{self._path}: rows were removed while they were read: read it again"
                )
            self._seen = version
            yield from self._db.execute(
                f"SELECT {', '.join(wanted)} FROM cells WHERE rowid <= ? AND {where.sql} "
                "ORDER BY rowid",
                (self._last, *where.given),
            )

    def places(self, where: Condition) -> NDArray[np.int64] | None:
        """Return where rows are among all of them, in their order; None for all."""
        if where == ALL:
            return None
        found = np.fromiter((row for (row,) in self.lines(["rowid"], where)), np.int64)
        if self._last == self._rows:  # numbers without gaps
            return found - 1
        every = np.fromiter((row for (row,) in self.lines(["rowid"], ALL)), np.int64)
        return np.searchsorted(every, found)

    def column(self, name: str) -> Array:
        """Return a column of all rows; some others are read with it, likely to come next.

        They are held, 8 bytes a row each: to go through the rows again costs far more.
        """
        if name not in self._held:
            room = max(1, ROOM // (8 * max(1, len(self))))
            names = [n for n in STORED[STORED.index(name) :] if n not in self._held][:room]
            self._held.update(self.arrays(names))
        return self._held[name]

    def arrays(self, names: Sequence[str]) -> dict[str, Array]:
        """Return columns as they are stored: numbers of texts, −1 for what is not defined.

        What is not defined among numbers is NaN.
        """
        real = [name for name in names if COLUMNS.get(name) == "number"]
        types = [(name, np.float64 if name in real else np.int64) for name in names]
        wanted = [f'coalesce("{name}", {"9e999" if name in real else -1})' for name in names]
        columns = {name: np.empty(self._rows, kind) for name, kind in types}
        lines = self.lines(wanted, ALL)
        try:
            for start in range(0, self._rows, PART):
                part = np.fromiter(islice(lines, PART), types)
                for name in names:
                    columns[name][start : start + PART] = part[name]
        except (TypeError, ValueError, OverflowError) as error:
            raise self.damaged(error) from error
        for name in real:
            columns[name][np.isinf(columns[name])] = np.nan
        for name in set(names) & {*TEXTS}:
            if lost := set(np.unique(columns[name]).tolist()) - self.texts.keys():
                raise self.damaged(f"text {min(lost)} of {name} is missing")
        if CASE in columns:
            columns[CASE] = columns[CASE].view(np.uint64)
        return columns

    def damaged(self, why: Any) -> StudyError:
        """Return the error for what no row can be."""
        return StudyError(f"{self._path}: is damaged: {why}. Take it from a copy, or remove it")

    def parts(self, names: Sequence[str], where: Condition) -> Iterator[dict[str, list[Any]]]:
        """Yield columns and axes as Python values, of so many rows as are held in memory."""
        stored = [name for name in names if name in COLUMNS or name == "axes"]
        lines = self.lines([*map(shown, stored), shown("axes")], where)
        while some := list(islice(lines, PART)):
            *columns, texts = map(list, zip(*some, strict=True))
            found = dict(zip(stored, map(self._checked, stored, columns), strict=True))
            axes = [self.axes(text) for text in texts]
            yield {n: found[n] if n in found else [a.get(n) for a in axes] for n in names}

    def _checked(self, name: str, values: list[Any]) -> list[Any]:
        """Return values as they are in Python; a damaged file may hold others."""
        kind = COLUMNS.get(name)
        try:
            if kind == "number":
                np.array(values, float)
        except (TypeError, ValueError) as error:
            raise self.damaged(error) from error
        if name in {"scenario", "estimator", "seed"} and None in values:
            raise self.damaged(f"{name} is missing")
        return [v if v is None else v > 0 for v in values] if kind == "truth" else values

    def value(self, name: str, stored: Any) -> Any:
        """Return what stands for a value of a column or an axis as it is stored."""
        if name not in COLUMNS:
            return self.axes(self.texts[stored]).get(name)
        if name in TEXTS:
            return self.texts[stored]
        if name == CASE:
            return f"{stored:016x}"
        if stored < 0 or math.isnan(stored):
            return None
        return bool(stored) if COLUMNS[name] == "truth" else stored

    def axes(self, text: str | None) -> dict[str, Any]:
        """Return the values on all axes, from their text."""
        if text not in self._axes:
            try:
                self._axes[text] = dict(json.loads(text or ""))
            except (ValueError, TypeError) as error:
                raise self.damaged(error) from error
        return self._axes[text]
