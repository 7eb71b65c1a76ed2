"""The columns of a row, the form of a file of rows, and what is said where that fails.

docs/studies.md says what each column means.
"""

from __future__ import annotations

import json
import math
import os
import re
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from flexaxis.experiments.scoring.score_definition import Kind
from flexaxis.experiments.scoring.score_table import SCORES, columns, units
from flexaxis.experiments.storage.files import NotRun, OutputError, StudyError

COLUMNS: Mapping[str, Kind] = {
    **dict.fromkeys(("case", "hash", "scenario", "base", "estimator", "method"), "text"),
    "seed": "integer",
    "onset": "number",
    "seconds": "number",
    "parameter": "text",
    "changed": "truth",
    **columns(),
    "code": "text",
    "error": "text",
    "rows": "integer",
    **dict.fromkeys(("cost.us_per_sample", "cost.seconds"), "number"),
    **dict.fromkeys(("cost.host", "cost.versions"), "text"),
}
"""Every column but those of the axes, which are named by the keys that are swept."""

KEY = ("estimator", "code", "hash", "seed", "parameter")
"""What a row is of: its inputs, each of which is once in a folder."""

UNITS: Mapping[str, str] = units() | {
    "onset": "s",
    "seconds": "s",
    "cost.us_per_sample": "us",
    "cost.seconds": "s",
}
"""Units of the columns that are numbers; empty for a plain number."""

_FIRST = ("case", "hash", "scenario", "estimator", "seed", "onset", "parameter", "changed",
          *SCORES)  # fmt: skip
_LAST = ("cost", "base", "method", "axes", "seconds", "code", "rows", "error")
_TABLES: dict[str, list[str]] = {}
for _table, _, _part in (name.partition(".") for name in COLUMNS if "." in name):
    _TABLES.setdefault(_table, []).append(_part)


def told(column: str) -> dict[str, str]:
    """Return what is said of a column of numbers in a file: `units`, `long_name`, `description`.

    Examples
    --------
    >>> told("cost.seconds")
    {'units': 's', 'long_name': 'cost seconds'}
    """
    score, _, part = column.partition(".")
    heading = SCORES[score].heading if score in SCORES else ""
    words = f"{heading or score} {part}".strip().replace("_", " ")
    found = {"units": UNITS.get(column) or "1", "long_name": words}
    return found | ({"description": SCORES[score].words} if score in SCORES else {})


def flat(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a row by column, its axes as JSON; what has a dot in its name lies in a table.

    Raises
    ------
    ValueError
        If something in it is not what its column holds; a number that is not finite, too.
    """
    found = {name: row.get(name) for name in COLUMNS if "." not in name}
    for table, parts in _TABLES.items():
        inside = row.get(table) or {}
        if not isinstance(inside, Mapping):
            raise ValueError(f"{table} is {inside!r}, and is to be a table")
        found |= {f"{table}.{part}": inside.get(part) for part in parts}
    for name, kind in COLUMNS.items():
        if not _fits(found[name], kind, name):
            raise ValueError(f"{name} is {found[name]!r}, and is to be a {kind}")
    if found["isolation"] is not None:
        found["isolation"] = json.dumps(found["isolation"])
    return found | {"axes": json.dumps(row.get("axes") or {})}


def _fits(value: Any, kind: Kind, name: str) -> bool:
    if value is None or name == "isolation":
        return name not in {"scenario", "estimator", "seed"}
    if kind == "text":
        return isinstance(value, str)
    if kind == "truth":
        return isinstance(value, bool)
    large = isinstance(value, int) and abs(value) >> 63  # more than SQLite holds
    if isinstance(value, bool) or not isinstance(value, int | float) or large:
        return False
    return math.isfinite(value) if kind == "number" else isinstance(value, int) and value >= 0


def nested(line: Mapping[str, Any]) -> dict[str, Any]:
    """Return what `flat` was given, in the order in which rows were always written."""
    found = dict(line)
    for table, parts in _TABLES.items():
        inside = {part: line[f"{table}.{part}"] for part in parts}
        undefined = table != "cost" and all(value is None for value in inside.values())
        if table == "bound":  # of what lies within the record
            inside = {part: value for part, value in inside.items() if value is not None}
        found[table] = None if undefined else inside
    for name, kind in COLUMNS.items():
        if kind == "truth" and found[name] is not None:
            found[name] = bool(found[name])
    if found["isolation"] is not None:
        found["isolation"] = json.loads(found["isolation"])
    found["axes"] = json.loads(found["axes"])
    row = {name: found[name] for name in (*_FIRST, *_LAST)}
    if row["onset"] is None:  # it is not drawn
        del row["onset"]
    return row


def axis_kind(values: Iterable[Any]) -> Kind:
    """Return the kind of column that holds the values of an axis.

    Examples
    --------
    >>> axis_kind([1, 1.5]), axis_kind(["f_m", "k_T"])
    ('number', 'text')
    """
    numbers = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    return "number" if numbers else "text"


def as_text(value: Any) -> str | None:
    """Return the value of an axis of texts, arrays or truths as text."""
    return value if value is None or isinstance(value, str) else json.dumps(value)


PATIENCE = 600.0  # s for which another process may write
CASE = "case"  # 64 bits
TEXTS = (*(name for name, kind in COLUMNS.items() if kind == "text" and name != CASE), "axes")
STORED = (CASE, *(name for name in COLUMNS if name not in {CASE, *TEXTS}), *TEXTS)
_TYPES = {"number": "REAL", "text": "INTEGER", "integer": "INTEGER", "truth": "INTEGER"}


_NAME = re.compile(r"scores(-\d+-of-\d+)?\.sqlite")


def file_of(shard: tuple[int, int] = (1, 1)) -> str:
    """Return the name of the file of rows of a share."""
    mine, shares = shard
    return "scores.sqlite" if shares == 1 else f"scores-{mine}-of-{shares}.sqlite"


def row_files(folder: Path) -> list[Path]:
    """Return the files of rows in a folder."""
    found = sorted(path for path in folder.glob("scores*") if _NAME.fullmatch(path.name))
    for path in found:
        if Path(f"{path}-journal").exists():  # of a kill: what it had not finished is taken back
            with said(path), closing(connect(path)) as db:
                db.execute("SELECT 1 FROM sqlite_master")
    return [path for path in found if path.stat().st_size]


def quoted(name: str) -> str:
    """Return a name of a column as SQL has it."""
    return '"' + name.replace('"', '""') + '"'


def shown(name: str) -> str:
    """Return what gives a column as it is read, from how it is stored."""
    if name == CASE:
        return "printf('%016x', \"case\")"
    if name in TEXTS:
        return f"(SELECT text FROM texts WHERE id = cells.{quoted(name)})"
    return f"cells.{quoted(name)}"


ROW = ", ".join(map(shown, STORED))


def of_axis(axis: str, text: str) -> str:
    """Return what gives the value on an axis, from the text of all axes."""
    path = '$."' + axis.replace("'", "''") + '"'
    return f"json_extract({text}, '{path}')"


def tables(axes: Sequence[str]) -> Iterator[str]:
    """Yield what makes the tables of a new file, and the view for everybody."""
    yield "CREATE TABLE texts (id INTEGER PRIMARY KEY, text TEXT UNIQUE)"
    yield "INSERT INTO texts VALUES (0, NULL)"
    columns = (f"{quoted(n)} {_TYPES[COLUMNS.get(n, 'text')]}" for n in STORED)
    key = ", ".join(map(quoted, KEY))
    yield f"CREATE TABLE cells ({', '.join(columns)}, PRIMARY KEY ({key}))"
    yield (
        "CREATE TABLE traces (estimator INTEGER, code INTEGER, hash INTEGER, seed INTEGER, "
        "trace BLOB, PRIMARY KEY (estimator, code, hash, seed))"
    )
    columns_shown = [f"{shown(name)} AS {quoted(name)}" for name in COLUMNS]
    columns_shown += [f"{of_axis(axis, shown('axes'))} AS {quoted(axis)}" for axis in axes]
    yield f"CREATE VIEW scores AS SELECT {', '.join(columns_shown)} FROM cells"


@contextmanager
def said(path: Path | None) -> Iterator[None]:
    """Say in one line what goes wrong with a file.

    Raises
    ------
    NotRun
        If the disk is full.
    OutputError
        If it cannot be written for another reason, or read.
    StudyError
        If it is damaged, or none of ours.
    """
    try:
        yield
    except sqlite3.OperationalError as error:
        if "no such column" in str(error) or "values were supplied" in str(error):
            raise StudyError(
                f"{path}: was made by another version of flexaxis, whose rows have other columns "
                f"({error}): run it again, into another folder or with --overwrite"
            ) from error
        full = "full" in str(error) or "disk I/O" in str(error)
        why = f"No space left on the disk ({error}): make room" if full else f"{error}"
        kind = NotRun if full else OutputError
        raise kind(f"{path}: cannot be written: {why}, or choose another place with -o") from error
    except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
        raise StudyError(
            f"{path}: is damaged, or no file of rows: {error}. Take it from a copy, or remove it; "
            "the same line then runs its cases again"
        ) from error


class _Connection(sqlite3.Connection):
    """One that is closed when nobody holds it any more, of which Python 3.13 warns."""

    def __del__(self) -> None:
        with suppress(sqlite3.ProgrammingError):  # it could not even be opened
            self.close()


def connect(path: Path | None, *, write: bool = False) -> sqlite3.Connection:
    """Return a connection to a file of rows, to one in memory where there is no path."""
    name = ":memory:" if path is None else path.resolve().as_uri()
    if path is not None and not write:  # what a kill has left can be taken back where it may be
        name += "?mode=rw" if os.access(path.parent, os.W_OK) else "?mode=ro"
    how: dict[str, Any] = {"uri": path is not None, "timeout": PATIENCE, "isolation_level": None}
    db = sqlite3.connect(name, check_same_thread=False, factory=_Connection, **how)
    only = "" if write else "; PRAGMA query_only = ON"
    db.executescript(f"PRAGMA trusted_schema = OFF; PRAGMA synchronous = NORMAL{only}")
    return db
