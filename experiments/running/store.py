"""Store the scores of a study in one SQLite file, with one transaction per unit of work.

The table `cases` contains one row per run of an estimator. The scores of a run are stored as the
bytes of a float64 matrix with one row per parameter, because a million rows of text would take
minutes to read. Other programs can read the scores from scores.csv. The table `variants` contains
the properties that all runs of one estimator on one scenario share. The table `traces` contains the
estimates as functions of time, for figures of single runs. The table `meta` contains the column
names, the software versions and the description of the last study.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
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
    make_folder,
)
from flexaxis.experiments.running.cache import digest_of
from flexaxis.experiments.running.case import Done, unpack
from flexaxis.experiments.scoring.summary import NUMBERS, Case
from flexaxis.sim.simulate import versions

ROWS, CSV = "scores.sqlite", "scores.csv"
WAIT = 600.0  # longest wait while another process writes [s]
SHARED = ("scenario", "estimator", "setting", "hash", "seconds", "axes", "parameters")
SCHEMA = """
PRAGMA synchronous = NORMAL;
CREATE TABLE IF NOT EXISTS meta (key TEXT PRIMARY KEY, value TEXT);
CREATE TABLE IF NOT EXISTS variants (id INTEGER PRIMARY KEY, about TEXT UNIQUE);
CREATE TABLE IF NOT EXISTS cases (id TEXT PRIMARY KEY, variant INTEGER, seed INTEGER,
    isolation TEXT, error TEXT, numbers BLOB);
CREATE INDEX IF NOT EXISTS in_order ON cases (variant, seed);
CREATE TABLE IF NOT EXISTS traces (id TEXT PRIMARY KEY, content BLOB);
"""
TAKE = """
BEGIN;
INSERT OR IGNORE INTO variants (about) SELECT about FROM other.variants;
INSERT OR IGNORE INTO cases
    SELECT c.id, mine.id, seed, isolation, error, numbers FROM other.cases c
    JOIN other.variants v ON v.id = variant JOIN variants mine ON mine.about = v.about;
INSERT OR IGNORE INTO traces SELECT id, content FROM other.traces;
COMMIT;
DETACH other;
"""


def made_with() -> dict[str, str]:
    """Return the package versions and the code digest on which the scores depend."""
    code = digest_of("models_mjcf", "sim", "estimators", "experiments.scoring")
    return versions() | {"code": code}


class Store:
    """An SQLite database of scores, which is stored in a folder or kept in memory.

    Parameters
    ----------
    folder : Path or None
        Folder of the database file. The folder is created if necessary. If `folder` is None, the
        database is in memory.
    overwrite : bool
        Whether to remove existing scores from the folder.

    Raises
    ------
    StudyError
        If the database file is damaged.
    OutputError, NotRun
        If the database file cannot be written.
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
        if self.told("columns") is None:
            self.tell(columns=NUMBERS, made_with=made_with())

    @classmethod
    def read(cls, folder: Path) -> Store:
        """Return the store in an existing folder.

        Raises
        ------
        StudyError
            If the folder contains no database of scores.
        """
        if not (folder / ROWS).is_file():
            raise StudyError(
                f"{folder} is not the folder of a run or a study, because it does not contain "
                f"{ROWS}. To create a results folder, use `flexaxis run … -o FOLDER` or "
                "`flexaxis study FILE.toml -o FOLDER`"
            )
        return cls(folder)

    def check(self) -> None:
        """Check that the stored scores were computed by the current version of the code.

        Raises
        ------
        StudyError
            If the stored scores were computed by another version of the code.
        """
        old, now = self.told("made_with"), made_with()
        differ = [
            f"{key} {old[key]}, now {now.get(key)}" for key in old if old[key] != now.get(key)
        ]
        if differ:
            raise StudyError(
                f"the scores in {self.folder} were computed with other software versions "
                f"({'; '.join(differ)}), so new scores cannot be added. Use -o to choose another "
                "folder, or --overwrite to remove the old scores"
            )

    def told(self, key: str) -> Any:
        """Return the value of a key such as ``study`` in the table `meta`, or None if missing."""
        with self._reported():
            query = "SELECT value FROM meta WHERE key = ?"
            return json.loads((self._db.execute(query, (key,)).fetchone() or ["null"])[0])

    def tell(self, **content: Any) -> None:
        """Store entries in the table `meta`, and replace existing entries with the same keys."""
        with self._reported(), self._db:
            lines = [(key, json.dumps(value, allow_nan=False)) for key, value in content.items()]
            self._db.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", lines)

    def done(self, *, traced: bool = False) -> set[str]:
        """Return all run ids; if `traced` is true, omit successful runs that have no trace."""
        some = " WHERE error NOT NULL OR id IN (SELECT id FROM traces)" if traced else ""
        with self._reported():
            return {case for (case,) in self._db.execute(f"SELECT id FROM cases{some}")}

    def add(self, cases: Iterable[Done]) -> None:
        """Add new runs in one transaction, without changing existing runs."""
        with self._reported(), self._db:
            for case in cases:
                self._db.execute("INSERT OR IGNORE INTO variants (about) VALUES (?)", (case.about,))
                self._db.execute(
                    "INSERT OR IGNORE INTO cases SELECT ?, id, ?, ?, ?, ? FROM variants "
                    "WHERE about = ?",
                    (case.id, case.seed, case.isolation, case.error, case.numbers, case.about),
                )
                if case.trace is not None:
                    line = case.id, case.trace
                    self._db.execute("INSERT OR IGNORE INTO traces VALUES (?, ?)", line)

    def take(self, folder: Path) -> None:
        """Add all runs from another folder.

        Raises
        ------
        StudyError
            If the other folder contains no scores, or scores from another version of the code.
        """
        other = Store.read(folder)
        other.check()
        with self._reported(), self._db:
            self._db.execute("ATTACH ? AS other", (other._path,))
            self._db.executescript(TAKE)
        if self.told("study") is None:
            self.tell(study=other.told("study"))

    def variants(self) -> dict[int, dict[str, Any]]:
        """Return the properties that all runs of a variant share, keyed by variant."""
        with self._reported():
            lines = self._db.execute("SELECT id, about FROM variants")
            return {key: json.loads(text) for key, text in lines}

    def frame(self, chosen: Mapping[int, Mapping[str, Any]]) -> pd.DataFrame:
        """Return the scores of some variants, with one row per run and parameter, sorted by seed.

        Parameters
        ----------
        chosen : mapping
            Selected entries of `variants`, in the order in which their rows are returned.
        """
        names, cases, numbers = self.told("columns"), [], bytearray()
        query = ("SELECT id, seed, isolation, error, numbers FROM cases "
                 "WHERE variant = ? ORDER BY seed")  # fmt: skip
        with self._reported():
            for key in chosen:
                for *case, content in self._db.execute(query, (key,)):
                    cases.append((key, *case))
                    numbers += content
        about = pd.DataFrame(chosen.values(), [*chosen], SHARED)
        table = pd.DataFrame(cases, columns=["variant", "case", "seed", "isolation", "error"])
        table = table.join(about, "variant").explode("parameters", ignore_index=True)
        matrix = np.frombuffer(numbers).reshape(-1, len(names))
        table = pd.concat([table, pd.DataFrame(matrix, columns=names)], axis=1)
        truths = {name: table[name] > 0 for name in ("changed", "diverged", "failed")}
        return table.assign(**truths).rename(columns={"parameters": "parameter"})

    def traces(self, scenario_hash: str, setting: str) -> dict[int, Case]:
        """Return the estimates as functions of time, for figures of single runs, keyed by seed."""
        query = (
            "SELECT seed, content FROM cases JOIN traces USING (id) JOIN variants v "
            "ON v.id = variant WHERE json_extract(about, '$.hash') = ? "
            "AND json_extract(about, '$.setting') = ? ORDER BY seed"
        )
        with self._reported():
            rows = self._db.execute(query, (scenario_hash, setting)).fetchall()
        return {seed: unpack(content) for seed, content in rows}

    @contextmanager
    def _reported(self) -> Iterator[None]:
        """Convert an SQLite error to a flexaxis error with a one-line message."""
        try:
            yield
        except sqlite3.OperationalError as error:
            full = "full" in str(error) or "disk I/O" in str(error)
            kind, advice = (NotRun, "Free some space") if full else (OutputError, "Check the path")
            raise kind(
                f"{self._path}: cannot be written: {error}. {advice}, or use -o to choose another "
                "folder"
            ) from error
        except sqlite3.DatabaseError as error:
            raise StudyError(
                f"the file {self._path} is damaged, or is not a database of scores: {error}. "
                "Restore the file from a backup, or remove the file and repeat the command"
            ) from error
