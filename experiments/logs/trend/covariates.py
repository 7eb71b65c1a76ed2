"""What is known of each log besides its estimates: when it was, how warm it was."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading import hdf5_file, mat_file
from flexaxis.sim.errors import did_you_mean

Array = NDArray[np.float64]

KEYS = ("date", "datum", "created", "start", "start_time", "timestamp")  # attributes, variables
HEAD = 4096  # bytes of a text in which a date is looked for
CENTURY = (datetime(2000, 1, 1), datetime(2100, 1, 1))  # in which a number is a time

_KEY = re.compile(rf"\W*(?:{'|'.join(KEYS)})\s*[:=]\s*(.+)", re.IGNORECASE)
_DATES = [
    re.compile(
        rf"(?<!\d)((?:19|20)\d\d)({mark})(0[1-9]|1[0-2])\2(0[1-9]|[12]\d|3[01])"
        r"(?:[T _-]?([01]\d|2[0-3])[:hH_.-]?([0-5]\d)(?:[:_.-]?([0-5]\d))?(?:\.\d+)?)?(?!\d)"
    )
    for mark in ("[-_./]", "")
]


def found_in(text: str) -> datetime | None:
    """Return the first date in a text by ISO 8601, as ``2026-03-01T06:30`` or ``20260301_0630``.

    One that is written in parts goes before a mere number, which may be that of a machine.

    Examples
    --------
    >>> found_in("axis3_20260301_0630.csv")
    datetime.datetime(2026, 3, 1, 6, 30)
    >>> found_in("sn20190101_2026-03-01")
    datetime.datetime(2026, 3, 1, 0, 0)
    >>> found_in("02/05/2026") is None
    True
    """
    for match in (match for pattern in _DATES for match in pattern.finditer(text)):
        year, _, *others = match.groups()
        with suppress(ValueError):  # such as the 31st of February
            month, day, hour, minute, second = (int(part or 0) for part in others)
            return datetime(int(year), month, day, hour, minute, second)
    return None


def begun(path: Path) -> datetime | None:
    """Return when a log began, by what stands in it; None if nothing does.

    It takes a process for some formats.
    """
    with path.open("rb") as file:
        head = file.read(HEAD)
    texts: Iterable[str] = ()
    with suppress(LogError):  # the reader says what is wrong with it
        if b"\x89HDF\r\n\x1a\n" in head[:8] + head[512:520]:
            texts = hdf5_file.texts_of(path, KEYS)
        elif head.startswith(b"MATLAB"):
            texts = mat_file.texts_of(path, KEYS)
        elif b"\0" not in head:
            # any other date in a comment may be that of a calibration or of a program
            lines = head.decode("utf-8", errors="replace").splitlines()
            told = (_KEY.match(line) for line in lines if line[:1] in "#%;/" and line)
            texts = [match[1] for match in told if match]
    return next((date for text in texts if (date := found_in(text) or _by_number(text))), None)


def dated(path: Path, known: datetime | None) -> tuple[datetime, str] | None:
    """Return when a log began and what says so; None if nothing does.

    That is "file", if it is `known` from there, else "name", or "folder" if its name is a date.
    """
    told = {"file": known, "name": found_in(path.stem)}
    told["folder"] = found_in(path.absolute().parent.name)
    return next(((date, source) for source, date in told.items() if date), None)


def _by_number(text: str) -> datetime | None:
    """Return the time of a number of seconds since 1970, or of ms, µs or ns."""
    if re.fullmatch(r"\s*\d{9,19}(\.\d*)?\s*", text):
        for unit in (1.0, 1e-3, 1e-6, 1e-9):
            date = datetime(1970, 1, 1) + timedelta(seconds=min(int(float(text) * unit), 10**10))
            if CENTURY[0] <= date < CENTURY[1]:
                return date
    return None


@dataclass(frozen=True)
class Clock:
    """When logs were.

    Attributes
    ----------
    order : ndarray (n,) of int
        Numbers of the logs in the order of time.
    time : ndarray (n,)
        In that order: days since the first, or numbers from 1.
    dated : bool
        Whether all have a date.
    labels : tuple of str
        Day or name of each.
    """

    order: NDArray[np.int64]
    time: Array
    dated: bool
    labels: tuple[str, ...]


def clock(rows: Sequence[Mapping[str, Any]]) -> Clock:
    """Return when the logs of rows were: by their dates if all have one, else by their order."""
    dates = [datetime.fromisoformat(row["date"]).replace(tzinfo=None) if row["date"] else None
             for row in rows]  # fmt: skip
    known = [date for date in dates if date is not None]
    if len(known) < len(rows) or len(set(known)) < 2:
        names = tuple(str(row["log"]) for row in rows)
        return Clock(np.arange(len(rows)), np.arange(1.0, len(rows) + 1), False, names)
    order = np.array(sorted(range(len(rows)), key=lambda i: known[i]), int)
    days = np.array([(known[i] - known[order[0]]).total_seconds() / 86400 for i in order])
    clocked = len({date.date() for date in known}) < len(known)  # several in a day
    form = "%Y-%m-%d %H:%M" if clocked else "%Y-%m-%d"
    return Clock(order, days, True, tuple(known[i].strftime(form) for i in order))


def covariates_of(rows: Sequence[Mapping[str, Any]], given: Sequence[str]) -> dict[str, Array]:
    """Return covariates (n,) by name, NaN for a log that has none.

    Parameters
    ----------
    rows : sequence of mapping
        Of the logs that have estimates.
    given : sequence of str
        Columns of the logs, of which the mean is taken, or CSV files with the name of the log in
        the first column.

    Raises
    ------
    LogError
        If no log has one of them, or a file cannot be read.
    """
    found: dict[str, Array] = {}
    for text in given:
        if text.lower().endswith(".csv"):
            found |= _from_file(Path(text), rows)
            continue
        values = np.array([row["columns"].get(text, np.nan) for row in rows])
        if np.isnan(values).all():
            known = sorted({name for row in rows for name in row["columns"]})
            raise LogError(
                f"--covariate {text}: no log has such a column.{did_you_mean(text, known)} There "
                f"are {', '.join(known)}; a CSV with the name of each log and its value works too"
            )
        found[text] = values
    for name, values in found.items():
        if np.ptp(values[np.isfinite(values)]) == 0:
            raise LogError(
                f"--covariate {name}: is {values[np.isfinite(values)][0]:g} in all logs and "
                "explains nothing; leave it out"
            )
    return found


def _from_file(path: Path, rows: Sequence[Mapping[str, Any]]) -> dict[str, Array]:
    try:
        text = path.read_text(encoding="utf-8-sig")
        semicolons = ";" in text.partition("\n")[0]  # and with them decimal commas
        lines = list(csv.reader(text.splitlines(), delimiter=";" if semicolons else ","))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise LogError(f"{path}: cannot be read: {error}") from error
    lines = [line for line in lines if line]
    if len(lines) < 2 or len(lines[0]) < 2:
        raise LogError(f"{path}: give a line of names, log,temp, and a line for each log")
    names = [name.strip() for name in lines[0][1:]]
    table = {line[0].strip(): line[1:] for line in lines[1:]}
    found = {name: np.full(len(rows), np.nan) for name in names}
    for i, row in enumerate(rows):
        log = Path(row["log"])
        known = (log.as_posix(), log.with_suffix("").as_posix(), log.parent.as_posix())
        cells = next((table[name] for name in known if name in table), [])
        for name, written in zip(names, cells, strict=False):
            cell = written.replace(",", ".") if semicolons else written
            try:
                found[name][i] = float(cell) if cell.strip() else np.nan
            except ValueError:
                raise LogError(f"{path}: {name} of {row['log']} is {cell!r}, no number") from None
    for name, values in found.items():
        if np.isnan(values).all():
            raise LogError(
                f"{path}: has no {name} for any of these logs; its first column takes the names of "
                f"the logs, such as {rows[0]['log']}"
            )
    return found
