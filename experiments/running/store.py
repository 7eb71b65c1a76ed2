"""The rows of a folder: one SQLite file, one transaction a unit, each case once by its key.

Table `cases` has a line a case. Its scores are the bytes of a matrix (parameters, columns) of
float64, because a million rows as text would take minutes to read; scores.csv is for everybody.
`variants` has what the cases of one estimator on one scenario share, `traces` what the figures of
single runs need, and `meta` the columns, the versions, and the study that was asked for last.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from flexaxis.experiments.files import (
    REPORT,
    SUMMARY,
    NotRun,
    OutputError,
    StudyError,
    digest_of,
    make_folder,
)
from flexaxis.experiments.running.case import NUMBERS, Done, unpack
from flexaxis.experiments.scoring.summary import Case
from flexaxis.sim.simulate import versions

ROWS, CSV = "scores.sqlite", "scores.csv"
WAIT = 600.0  # s for another process that writes
TRUTHS = ("changed", "diverged", "failed")  # that are defined in every row
SCHEMA = """
PRAGMA synchronous = NORMAL;
CREATE TABLE IF NOT EXISTS meta (key TEXT PRIMARY KEY, value TEXT);
CREATE TABLE IF NOT EXISTS variants (id INTEGER PRIMARY KEY, about TEXT UNIQUE);
CREATE TABLE IF NOT EXISTS cases (id TEXT PRIMARY KEY, variant INTEGER, seed INTEGER,
    isolation TEXT, error TEXT, host TEXT, numbers BLOB);
CREATE TABLE IF NOT EXISTS traces (id TEXT PRIMARY KEY, content BLOB);
"""


def made_with() -> dict[str, str]:
    """Return what decides about rows: versions, and a digest of simulation, estimators, scores."""
    code = digest_of("models_mjcf", "sim", "estimators", "experiments.scoring")
    return versions() | {"code": code}


class Store:
    """Rows in a folder, or in memory without one.

    Parameters
    ----------
    folder : Path or None
        Made if it is missing.
    overwrite : bool
        Whether to remove the rows that are there.

    Raises
    ------
    StudyError
        If rows are there that were made by other code.
    OutputError, NotRun
        If the file cannot be written.
    """

    def __init__(self, folder: Path | None = None, *, overwrite: bool = False) -> None:
        self.folder, self._path = folder, ":memory:"
        if folder is not None:
            make_folder(folder)
            self._path = str(folder / ROWS)
            for name in (ROWS, f"{ROWS}-journal", SUMMARY, REPORT, CSV) if overwrite else ():
                (folder / name).unlink(missing_ok=True)
        with self._reported():
            self._db = sqlite3.connect(self._path, WAIT, check_same_thread=False)
            self._db.executescript(SCHEMA)
            with self._db:
                content = {"columns": json.dumps(NUMBERS), "made_with": json.dumps(made_with())}
                self._db.executemany("INSERT OR IGNORE INTO meta VALUES (?, ?)", content.items())

    @classmethod
    def read(cls, folder: Path) -> Store:
        """Return the rows of a folder to be read.

        Raises
        ------
        StudyError
            If it has none.
        """
        path = folder / ROWS
        if not path.is_file():
            raise StudyError(
                f"{folder} is not the folder of a run or a study ({ROWS} is missing). Make one "
                "with `flexaxis run … -o FOLDER` or `flexaxis study FILE.toml -o FOLDER`"
            )
        store = cls.__new__(cls)
        store.folder, store._path = folder, str(path)
        mode = "rw" if os.access(folder, os.W_OK) else "ro"  # rw also undoes what a kill left
        with store._reported():
            uri = f"{path.resolve().as_uri()}?mode={mode}"
            store._db = sqlite3.connect(uri, WAIT, uri=True, check_same_thread=False)
            store._meta("columns")
        return store

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    def check(self) -> None:
        """Refuse to add rows to those of other code.

        Raises
        ------
        StudyError
        """
        known = made_with()
        differ = [f"{key} {value}, now {known.get(key)}" for key, value in self.made_with.items()
                  if known.get(key) != value]  # fmt: skip
        if differ:
            raise StudyError(
                f"{self.folder} was made by other code ({'; '.join(differ)}), and its rows must "
                "not be mixed with new ones: choose another folder with -o, or remove them with "
                "--overwrite"
            )

    @property
    def made_with(self) -> dict[str, str]:
        """What made the rows that are there."""
        with self._reported():
            return dict(json.loads(self._meta("made_with")))

    def _meta(self, key: str) -> str:
        line = self._db.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return str(line[0]) if line else "null"

    @property
    def study(self) -> dict[str, Any] | None:
        """The study that was asked for last, as `set_study` took it."""
        with self._reported():
            found: dict[str, Any] | None = json.loads(self._meta("study"))
        return found

    def set_study(self, content: Mapping[str, Any]) -> None:
        """Keep what was asked for."""
        with self._reported(), self._db:
            text = json.dumps(content, allow_nan=False)
            self._db.execute("INSERT OR REPLACE INTO meta VALUES ('study', ?)", (text,))

    def done(self, *, traced: bool = False) -> set[str]:
        """Return the ids of all cases, or of those that failed or have a trace."""
        some = " WHERE error NOT NULL OR id IN (SELECT id FROM traces)" if traced else ""
        with self._reported():
            return {case for (case,) in self._db.execute(f"SELECT id FROM cases{some}")}

    def add(self, cases: Iterable[Done]) -> None:
        """Add cases, all or none; one that is there stays as it is."""
        with self._reported(), self._db:
            for case in cases:
                self._db.execute("INSERT OR IGNORE INTO variants (about) VALUES (?)", (case.about,))
                self._db.execute(
                    "INSERT OR IGNORE INTO cases SELECT ?, id, ?, ?, ?, ?, ? FROM variants "
                    "WHERE about = ?",
                    (case.id, case.seed, case.isolation, case.error, case.host,
                     case.numbers.tobytes(), case.about),
                )  # fmt: skip
                if case.trace is not None:
                    line = case.id, case.trace
                    self._db.execute("INSERT OR IGNORE INTO traces VALUES (?, ?)", line)

    def take(self, folder: Path) -> int:
        """Add the cases of another folder; return how many it has.

        Raises
        ------
        StudyError
            If it has none, or other code made them.
        """
        with closing(Store.read(folder)) as other:
            other.check()
        with self._reported():
            self._db.execute("ATTACH ? AS other", (str(folder / ROWS),))
            with self._db:
                self._db.execute("INSERT OR IGNORE INTO variants (about) "
                                 "SELECT about FROM other.variants")  # fmt: skip
                self._db.execute(
                    "INSERT OR IGNORE INTO cases SELECT c.id, m.id, seed, isolation, error, host, "
                    "numbers FROM other.cases c JOIN other.variants o ON o.id = c.variant "
                    "JOIN main.variants m USING (about)"
                )
                self._db.execute("INSERT OR IGNORE INTO traces SELECT * FROM other.traces")
                self._db.execute("INSERT OR IGNORE INTO meta SELECT * FROM other.meta")
            (count,) = self._db.execute("SELECT count(*) FROM other.cases").fetchone()
            self._db.execute("DETACH other")
        return int(count)

    def variants(self) -> dict[int, dict[str, Any]]:
        """Return what the cases of each estimator on each scenario share, by its number."""
        with self._reported():
            return {key: json.loads(text) for key, text in
                     self._db.execute("SELECT id, about FROM variants")}  # fmt: skip

    def frame(self, chosen: Mapping[int, Mapping[str, Any]]) -> pd.DataFrame:
        """Return the rows of some variants, a line a case and parameter, seed by seed.

        Parameters
        ----------
        chosen : mapping
            Some of `variants`, in the order of the rows.
        """
        with self._reported():
            rank = {key: place for place, key in enumerate(chosen)}
            query = "SELECT rowid, variant, seed, id, isolation, error, host FROM cases"
            cases = [line for line in self._db.execute(query) if line[1] in rank]
            cases.sort(key=lambda line: (rank[line[1]], line[2]))
            sizes = [len(chosen[line[1]]["parameters"]) for line in cases]
            starts = dict(zip((line[0] for line in cases), np.cumsum([0, *sizes]), strict=False))
            names = json.loads(self._meta("columns"))
            numbers = np.empty((len(names), sum(sizes)))
            for row, content in self._db.execute("SELECT rowid, numbers FROM cases"):
                if row in starts:
                    part = np.frombuffer(content).reshape(-1, len(names))
                    numbers[:, starts[row] : starts[row] + len(part)] = part.T
        place = np.repeat(np.arange(len(cases)), sizes)
        parts = zip(*cases, strict=True) if cases else ((),) * 7
        texts = dict(zip(("rowid", "variant", "seed", "case", "isolation", "error", "cost.host"),
                         parts, strict=True))  # fmt: skip
        columns = {key: np.array(texts[key], object)[place] for key in list(texts)[3:]}
        variant = np.array([rank[key] for key in texts["variant"]], int)[place]
        shared = ("scenario", "estimator", "setting", "hash", "seconds", "axes")
        for key in shared:
            values = np.empty(len(chosen), object)
            values[:] = [about[key] for about in chosen.values()]
            columns[key] = values[variant]
        columns["seed"] = np.array(texts["seed"], np.int64)[place]
        columns["parameter"] = np.array(
            [name for line in cases for name in chosen[line[1]]["parameters"]], object
        )
        columns |= dict(zip(names, numbers, strict=True))
        columns |= {name: columns[name] > 0 for name in TRUTHS}
        return pd.DataFrame(columns, copy=False)

    def traces(self, scenario_hash: str, setting: str) -> dict[int, Case]:
        """Return what the figures of single runs need, by seed."""
        query = (
            "SELECT seed, content FROM cases JOIN traces USING (id) JOIN variants v "
            "ON v.id = variant WHERE json_extract(about, '$.hash') = ? "
            "AND json_extract(about, '$.setting') = ? ORDER BY seed"
        )
        with self._reported():
            found = self._db.execute(query, (scenario_hash, setting)).fetchall()
        return {seed: unpack(content) for seed, content in found}

    @contextmanager
    def _reported(self) -> Iterator[None]:
        """Say in one line what goes wrong with the file."""
        try:
            yield
        except sqlite3.OperationalError as error:
            with suppress(sqlite3.Error):
                self._db.rollback()
            full = "full" in str(error) or "disk I/O" in str(error)
            kind, advice = (NotRun, ": free some space") if full else (OutputError, "")
            raise kind(
                f"{self._path}: cannot be written: {error}{advice}, or choose another place with -o"
            ) from error
        except sqlite3.DatabaseError as error:
            raise StudyError(
                f"{self._path} is damaged, or no file of rows: {error}. Restore it from a copy, or "
                "remove it; the same command then runs its cases again"
            ) from error
