"""Estimates with intervals from many logs of one axis: a row a log, never computed twice."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.files import REPORT, OutputError, make_folder
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.files import labels
from flexaxis.experiments.logs.identification.identify import GIVEN
from flexaxis.experiments.logs.importing import read_any
from flexaxis.experiments.logs.reading.log import open_log
from flexaxis.experiments.logs.trend.covariates import dated
from flexaxis.experiments.logs.trend.refit import refit, seen
from flexaxis.experiments.running.run import parallel
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.record import Record

ROWS, RESULT = "rows.sqlite", "trend.json"
TRIES = 5  # logs from which it is seen what they can tell
METHOD = 7  # of the estimates; another number and all are made anew


@dataclass(frozen=True)
class Source:
    """How logs are read.

    Attributes
    ----------
    tables, treatment : mapping
        As for `flexaxis.experiments.logs.importing.read_any`.
    torque : {"", "held", "smooth"}
        What the torque of all logs is, where the tables do not say it: a guess from each log
        might be another one from day to day.
    """

    tables: Mapping[str, Any]
    treatment: Mapping[str, Any]
    torque: str = ""

    def read(self, path: Path) -> Record:
        """Return a log as a record; errors as from `read_any`."""
        tables = dict(self.tables)
        if self.torque and (tables or path.suffix != ".nc"):  # a record says it itself
            tables = {"torque_is": self.torque} | tables
        return read_any(path, tables, **self.treatment)


@dataclass(frozen=True)
class Plan:
    """What is done to each log.

    Attributes
    ----------
    axis : Axis
    names : tuple of str
        Parameters to estimate.
    source : Source
    """

    axis: Axis
    names: tuple[str, ...]
    source: Source

    @property
    def text(self) -> str:
        """All that the estimates of a log depend on besides the log."""
        axis = [self.axis.tables, dict(self.axis.model.nominal)]
        axis += [getattr(self.axis, key) for key in ("delay", "torque_is", "highpass")]
        every = [METHOD, version("flexaxis"), axis, self.names, *vars(self.source).values()]
        return json.dumps(every, sort_keys=True, default=str)

    def case(self, path: Path) -> str:
        """Return the identity of what comes of a log: by its content, and what is done to it."""
        try:
            with path.open("rb") as file:
                content = hashlib.file_digest(file, "sha256").hexdigest()
        except OSError as error:
            raise LogError(f"{path}: cannot be read: {error.strerror}") from error
        return hashlib.sha256((self.text + content).encode()).hexdigest()[:16]


def plan_for(logs: Sequence[Path], axis: Axis, source: Source, names: Sequence[str] = ()) -> Plan:
    """Return what is to be done to each log, as the first one that can be read shows it.

    Parameters
    ----------
    logs : sequence of Path
    axis : Axis
    source : Source
    names : sequence of str
        Parameters to estimate; by default those that this log tells, see `refit.seen`.

    Raises
    ------
    LogError
        If a name is of a parameter that is zero, or none of the first `TRIES` can be used, as of
        the first of them.
    """
    for name in names:
        if not axis.model.nominal[name]:
            raise LogError(
                f"--free {name}: is 0 in the axis, and steps are parts of what is known: give a "
                f"value of about its size in the axis, or leave it out"
            )
    candidates = [n for n in axis.model.parameters if n not in GIVEN and axis.model.nominal[n]]
    problem: FlexaxisError | EstimatorError | None = None
    for path in logs[:TRIES]:
        try:
            record = source.read(path)
            chosen = tuple(dict.fromkeys(names)) or seen(record, axis, candidates)
            return Plan(axis, chosen, replace(source, torque=record.versions.get("torque", "")))
        except (FlexaxisError, EstimatorError) as error:
            problem = problem or error
    raise problem or LogError("there are no logs")


class Lines:
    """Tables by a key of theirs in an SQLite file; each is written at once."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with self._reported():
            self._db = sqlite3.connect(path, 600.0)
            self._db.execute("CREATE TABLE IF NOT EXISTS lines (key TEXT PRIMARY KEY, line TEXT)")

    def __enter__(self) -> Lines:
        return self

    def __exit__(self, *error: object) -> None:
        self._db.close()

    def all(self) -> dict[str, dict[str, Any]]:
        """Return all of them, by their keys."""
        with self._reported():
            return {k: json.loads(v) for k, v in self._db.execute("SELECT key, line FROM lines")}

    def put(self, key: str, line: Mapping[str, Any]) -> None:
        """Keep one, in the place of what has this key."""
        with self._reported(), self._db:
            text = json.dumps(line, allow_nan=False)
            self._db.execute("INSERT OR REPLACE INTO lines VALUES (?, ?)", (key, text))

    @contextmanager
    def _reported(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            raise OutputError(f"{self._path}: cannot be read or written: {error}") from error


def estimate_all(
    plan: Plan,
    logs: Sequence[Path],
    folder: Path,
    *,
    jobs: int = 1,
    advance: Callable[[float], None] = lambda amount: None,
) -> list[dict[str, Any]]:
    """Estimate from the logs that have no row yet; return the rows of all, in the order given.

    Parameters
    ----------
    plan : Plan
    logs : sequence of Path
    folder : Path
        Where `ROWS` is, or is made.
    jobs : int
        Processes.
    advance : callable
        Called with the number of logs done since its last call.

    Raises
    ------
    OutputError
        If they cannot be written there.
    KeyboardInterrupt
        On Ctrl-C, when what was at work is done: it is not lost.
    """
    make_folder(folder)
    name, alike = labels(logs), dict[str, list[Path]]()
    for path in logs:  # a copy is no further measurement
        alike.setdefault(plan.case(path), []).append(path)
    with Lines(folder / ROWS) as rows:
        there = rows.all()
        missing = [same[0] for case, same in alike.items() if case not in there]
        advance(len(logs) - len(missing))
        for row in parallel(partial(row_of, plan), missing, jobs=jobs):
            rows.put(row["case"], row)
            advance(1)
        every = rows.all()
    # the same content may come by another name, and with it by another date
    return [
        every[case] | {"log": name[path], "date": (at := dated(path)) and at.isoformat(),
                       "copies": [name[copy] for copy in copies]}
        for case, (path, *copies) in alike.items()
    ]  # fmt: skip


def row_of(plan: Plan, path: Path) -> dict[str, Any]:
    """Return the row of a log: its estimates, or what is wrong with it."""
    row: dict[str, Any] = {"case": plan.case(path), "log": path.name, "problem": ""}
    try:
        found = estimated(plan.source.read(path), plan.axis, plan.names)
        return row | found | ({} if "problem" in found else {"columns": _means(path)})
    except (FlexaxisError, EstimatorError) as error:
        row["problem"] = " ".join(str(error).split())
    except Exception as error:  # whatever a strange log leads to: the others go on
        row["problem"] = f"unexpected {type(error).__name__}: {' '.join(str(error).split())}"
    return row


def estimated(record: Record, axis: Axis, names: Sequence[str]) -> dict[str, Any]:
    """Return what a record adds to the row of its log, but for the means of its columns."""
    try:
        with np.errstate(all="ignore"):
            found = refit(record, axis, names)
    except (LogError, EstimatorError) as error:  # it was read, but is not like its axis
        return {"problem": " ".join(str(error).split()), "unlike": True}
    if (
        not np.isfinite([*found.theta, *found.deviations, found.fit]).all()
        or not (found.deviations > 0).all()
    ):
        raise LogError("this log tells nothing of the parameters: did the axis move?")
    each = zip(found.names, found.theta.tolist(), found.deviations.tolist(), strict=True)
    return {
        "estimates": {name: {"value": value, "sd": sd} for name, value, sd in each},
        **{name: dict(zip(("value", "sd"), getattr(found, name), strict=True))
           for name in ("offset", "late")},
        **{name: getattr(found, name) for name in ("fit", "error", "left")},
        "period": record.period,
    }  # fmt: skip


def _means(path: Path) -> dict[str, float]:
    """Return the mean of each column of a log, any of which may explain the estimates."""
    columns = open_log(path).numbers()
    there = {name: values[np.isfinite(values)] for name, values in columns.items()}
    return {name: float(values.mean()) for name, values in there.items() if len(values)}


def check_folder(folder: Path, given: Sequence[Path]) -> None:
    """Raise a LogError if a folder holds logs, or a page that is not of a trend."""
    if any(path.is_dir() and path.resolve() == folder.resolve() for path in given):
        raise LogError(f"-o {folder}: the logs are there; choose another folder")
    for name in (RESULT, REPORT):
        if (folder / name).exists() and not (folder / ROWS).exists():
            raise LogError(f"{folder} holds {name}, which is not of a trend: choose another folder")
