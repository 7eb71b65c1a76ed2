"""What is known of each log besides its estimates: when it was, how warm it was."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.files import labels
from flexaxis.experiments.logs.reading.log import open_log
from flexaxis.sim.errors import did_you_mean
from flexaxis.sim.files import read_text

Array = NDArray[np.float64]

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


def dated(path: Path) -> datetime | None:
    """Return when a log began, by its name or that of its folder; None if neither says it."""
    return found_in(path.stem) or found_in(path.absolute().parent.name)


@dataclass(frozen=True)
class Clock:
    """When logs were.

    Attributes
    ----------
    order : ndarray (n,) of int
        Numbers of the logs in the order of time.
    time : ndarray (n,)
        In that order: days since the first, or numbers from 1.
    labels : tuple of str
        Day or name of each.
    first : str
        When the first was by ISO 8601, where all have a date; else empty.
    """

    order: NDArray[np.int64]
    time: Array
    labels: tuple[str, ...]
    first: str = ""


def clock(rows: Sequence[Mapping[str, Any]]) -> Clock:
    """Return when the logs of rows were: by their dates if all have one, else by their order."""
    dates = [row["date"] for row in rows]
    if None in dates or len(set(dates)) < 2:
        names = tuple(str(row["log"]) for row in rows)
        return Clock(np.arange(len(rows)), np.arange(1.0, len(rows) + 1), names)
    when = np.array(dates, "datetime64[s]")
    order = np.argsort(when, kind="stable")
    when = when[order]
    several = len(np.unique(when.astype("datetime64[D]"))) < len(when)  # in a day
    labels = (
        str(each).replace("T", " ") for each in when.astype(f"datetime64[{'mD'[not several]}]")
    )
    return Clock(order, (when - when[0]) / np.timedelta64(1, "D"), tuple(labels), str(when[0]))


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
        else:
            found[text] = np.array([row["columns"].get(text, np.nan) for row in rows])
    known = sorted({name for row in rows for name in row["columns"]})
    for name, values in found.items():
        there = values[np.isfinite(values)]
        if not len(there):
            raise _missing(name, known, rows[0]["log"])
        if np.ptp(there) == 0:
            raise LogError(
                f"--covariate {name}: is {there[0]:g} in all logs and explains nothing; leave it "
                "out"
            )
    return found


def check_columns(logs: Sequence[Path], given: Sequence[str]) -> None:
    """Raise a LogError, as `covariates_of` would, if no log has a column by its head.

    A log that cannot be read has none.
    """
    for name in given:
        if name.lower().endswith(".csv"):
            covariates_of([{"log": log, "columns": {}} for log in labels(logs).values()], [name])
            continue
        heads = list[tuple[str, ...]]()
        for path in logs:
            with suppress(LogError):
                heads.append(open_log(path).names)
            if heads and name in heads[-1]:
                break
        else:
            if heads:
                raise _missing(name, sorted(heads[0]), labels(logs)[logs[0]])


def _missing(name: str, known: Sequence[str], log: str) -> LogError:
    return LogError(
        f"--covariate {name}: no log has it as a column.{did_you_mean(name, known)} There "
        f"are {', '.join(known)}; or give a CSV, log,temp, with a line for each log and "
        f"its name in the first column, such as {log}"
    )


def _from_file(path: Path, rows: Sequence[Mapping[str, Any]]) -> dict[str, Array]:
    """Return the columns of a table whose first one has the names of logs, or of their folders."""
    import pandas

    text = read_text(path, LogError)
    mark, point = (";", ",") if ";" in text.partition("\n")[0] else (",", ".")
    try:
        table = pandas.read_csv(
            StringIO(text), sep=mark, decimal=point, index_col=0, dtype={0: str}
        )
        table = table.rename(index=str.strip, columns=str.strip).astype(float)
    except (ValueError, TypeError) as error:
        raise LogError(f"{path}: give log,temp, and a line for each log ({error})") from error
    table, logs = table[~table.index.duplicated()], [Path(row["log"]) for row in rows]
    ways = [(log.as_posix(), log.with_suffix("").as_posix(), str(log.parent)) for log in logs]
    named = [next((name for name in each if name in table.index), "") for each in ways]
    return {name: table[name].reindex(named).to_numpy() for name in table.columns}
