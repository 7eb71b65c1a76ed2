"""The rows of a folder in an SQLite file: a unit of work is one transaction, a row is there once.

Anyone reads it by its view `scores`. Texts are kept once, and what a row is of is the key of its
table, so that two processes may add to one file and nothing is there twice. Its journal is rolled
back, and not written ahead, which works on a network, too; there each share has a file of its own.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.storage.files import dumps
from flexaxis.experiments.storage.schema import (
    CASE,
    KEY,
    ROW,
    STORED,
    TEXTS,
    connect,
    flat,
    nested,
    quoted,
    said,
    tables,
)

Row = dict[str, Any]
_MARKS = ", ".join("?" * len(STORED))


class Store:
    """A file of rows to add to. A context manager.

    Parameters
    ----------
    path : Path, optional
        Made if it is missing; without one the rows stay in memory.
    axes : sequence of str
        Swept keys.

    Raises
    ------
    OutputError, StudyError
        As from `said`.
    """

    def __init__(self, path: Path | None, axes: Sequence[str] = ()) -> None:
        self._path, self._ids = path, dict[str | None, int]()
        with self._said():
            self.db = connect(path, write=True)
            with self._transaction():
                if not self.db.execute("SELECT 1 FROM sqlite_master LIMIT 1").fetchone():
                    for line in tables(axes):
                        self.db.execute(line)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.db.close()

    def add(self, rows: Sequence[Row], traces: Sequence[tuple[Row, bytes]] = ()) -> None:
        """Add rows, all or none of them; what is there already stays as it is.

        Parameters
        ----------
        rows : sequence of dict
            Those of whole cases.
        traces : sequence of (dict, bytes)
            What figures are drawn from, each with a row of its case.
        """
        with self._said(), self._transaction():
            self.db.executemany(f"INSERT OR IGNORE INTO cells VALUES ({_MARKS})",
                                 [self._stored(row) for row in rows])  # fmt: skip
            self.db.executemany("INSERT OR IGNORE INTO traces VALUES (?, ?, ?, ?, ?)",
                                 [(*self._key(row), trace) for row, trace in traces])  # fmt: skip

    def rows(self, scenario_hash: str, estimator: str, code: str | None) -> list[Row]:
        """Return the rows of an estimator on a scenario, in the order in which they came."""
        with self._said():
            return list(_read(self.db, OF_CASES, (estimator, code, scenario_hash)))

    def done(self, codes: Mapping[str, str | None]) -> NDArray[np.uint64]:
        """Return the cases of some estimators, by their text, with some code; sorted."""
        with self._said():
            return done_in(self.db, codes)

    def take(self, other: Path) -> int:
        """Add the rows of another file; return how many cases it has."""
        with self._said():
            self.db.execute("ATTACH ? AS other", (other.resolve().as_uri() + "?mode=ro",))
            with self._transaction():
                for line in _TAKE:
                    self.db.execute(line)
            self.db.execute("DETACH other")
        with closing(connect(other)) as db:
            return cases_in(db)

    @property
    def cases(self) -> int:
        """How many it has."""
        with self._said():
            return cases_in(self.db)

    def _stored(self, row: Row) -> list[Any]:
        line = flat(row)
        case = int(line[CASE], 16)
        line[CASE] = case - (1 << 64) if case >> 63 else case
        return [self._id(line[name]) if name in TEXTS else line[name] for name in STORED]

    def _key(self, row: Row) -> list[Any]:
        return [*(self._id(row[name]) for name in KEY[:3]), row["seed"]]

    def _id(self, text: str | None) -> int:
        """Return the number of a text, a new one where it has none."""
        if text is None:
            return 0
        if text not in self._ids:
            self.db.execute("INSERT OR IGNORE INTO texts (text) VALUES (?)", (text,))
            found = self.db.execute("SELECT id FROM texts WHERE text = ?", (text,)).fetchone()
            self._ids[text] = int(found[0])
        return self._ids[text]

    def _said(self) -> AbstractContextManager[None]:
        return said(self._path)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self.db.execute("BEGIN IMMEDIATE")
        try:
            yield
            self.db.execute("COMMIT")
        except BaseException:  # Ctrl-C too
            self._ids.clear()
            if self.db.in_transaction:  # a full disk has ended it already
                self.db.execute("ROLLBACK")
            raise


OF_CASES = (
    "estimator = (SELECT id FROM texts WHERE text IS ?) AND "
    "code = (SELECT id FROM texts WHERE text IS ?) AND "
    "hash = (SELECT id FROM texts WHERE text IS ?) ORDER BY rowid"
)
"""Where rows are of an estimator, its code and a scenario by its hash."""


class Lines:
    """Tables by a key of theirs, each in an SQLite file of its own transaction.

    A context manager; errors as from `said`.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with said(path):
            self.db = connect(path, write=True)
            self.db.execute("CREATE TABLE IF NOT EXISTS lines (key TEXT PRIMARY KEY, line TEXT)")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.db.close()

    def all(self) -> dict[str, Row]:
        """Return all of them, by their keys."""
        with said(self._path):
            return {k: json.loads(v) for k, v in self.db.execute("SELECT key, line FROM lines")}

    def put(self, key: str, line: Row) -> None:
        """Keep one, in the place of what has this key."""
        with said(self._path):
            self.db.execute("INSERT OR REPLACE INTO lines VALUES (?, ?)", (key, dumps(line)))


_TAKEN = ", ".join(
    f"(SELECT new FROM renumbered WHERE old = c.{quoted(name)})" if name in TEXTS
    else f"c.{quoted(name)}" for name in STORED
)  # fmt: skip
_OWN = ", ".join(f"(SELECT new FROM renumbered WHERE old = t.{name})" for name in KEY[:3])
_TAKE = (
    "INSERT OR IGNORE INTO texts (text) SELECT text FROM other.texts WHERE text NOT NULL",
    "CREATE TEMP TABLE renumbered (old INTEGER PRIMARY KEY, new INTEGER)",
    "INSERT INTO renumbered SELECT o.id, m.id FROM other.texts o JOIN main.texts m USING (text)",
    "INSERT INTO renumbered VALUES (0, 0)",
    f"INSERT OR IGNORE INTO main.cells SELECT {_TAKEN} FROM other.cells c ORDER BY c.rowid",
    f"INSERT OR IGNORE INTO main.traces SELECT {_OWN}, seed, trace FROM other.traces t",
    "DROP TABLE renumbered",
)


def cases_in(db: sqlite3.Connection) -> int:
    """Return how many cases are in an open file."""
    query = "SELECT count(*) FROM (SELECT DISTINCT estimator, code, hash, seed FROM cells)"
    return int(db.execute(query).fetchone()[0])


def _read(db: sqlite3.Connection, where: str, given: Sequence[Any]) -> Iterator[Row]:
    for line in db.execute(f"SELECT {ROW} FROM cells WHERE {where}", given):
        yield nested(dict(zip(STORED, line, strict=True)))


def done_in(db: sqlite3.Connection, codes: Mapping[str, str | None]) -> NDArray[np.uint64]:
    """Return the cases of some estimators, with some code, in an open file; sorted."""
    ids = dict(db.execute("SELECT text, id FROM texts"))
    found = [np.empty(0, np.uint64)]
    for text, code in codes.items():
        if text in ids and code in ids:
            query = 'SELECT "case" FROM cells WHERE estimator = ? AND code = ?'
            cases = (case for (case,) in db.execute(query, (ids[text], ids[code])))
            found.append(np.fromiter(cases, np.int64).view(np.uint64))
    return np.unique(np.concatenate(found))


_OF_CASE = "estimator, code, hash, seed"
OF_ONE = f"({_OF_CASE}) = (?, ?, ?, ?) ORDER BY rowid"
"""Where rows are of a case, as from `cases_of`."""


def cases_of(path: Path) -> Iterator[tuple[int, ...]]:
    """Yield what each case of a file is of."""
    with said(path), closing(connect(path)) as db:
        yield from db.execute(f"SELECT DISTINCT {_OF_CASE} FROM cells")


def rows_in(
    path: Path, where: str = "1 ORDER BY rowid", given: Sequence[Any] = ()
) -> Iterator[Row]:
    """Yield rows of a file, as they were written.

    Parameters
    ----------
    path : Path
    where : str
        Which, in SQL.
    given : sequence
        What its question marks stand for.
    """
    with said(path), closing(connect(path)) as db:
        yield from _read(db, where, given)
