"""The results of a study in Python: rows, selections, pooled scores, tables."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from flexaxis.experiments.running import rows as files
from flexaxis.experiments.running.axes import is_option
from flexaxis.experiments.running.columns import COLUMNS, as_text, axis_kind, flat
from flexaxis.experiments.running.errors import StudyError
from flexaxis.experiments.running.folder import read_study
from flexaxis.experiments.scoring.pooling import pool_rows
from flexaxis.experiments.scoring.table import SCORES
from flexaxis.experiments.scoring.theory import ALARMS
from flexaxis.sim.errors import unknown
from flexaxis.sim.timing import PERIOD

if TYPE_CHECKING:
    import pandas
    import xarray

# What a pooled row is made of, held as eight bytes each: a study may have millions of rows.
_PLAIN = tuple(s.name for s in SCORES.values() if s.kind in {"number", "truth"} and not s.parts)
_TRUTHS = tuple(name for name in _PLAIN if SCORES[name].kind == "truth")
# What takes whole trajectories, or all parameters of a case at once, is not pooled here.
_LEFT_OUT = (
    "t63", "t90", "rmse", "efficiency", "excess", "excess_interval",
    "scenario", "hash", "estimator", "seeds",
)  # fmt: skip


@dataclass(frozen=True)
class Results:
    """The rows of a study, all or some of them; read from the folder whenever they are asked for.

    Attributes
    ----------
    folder : Path
    study : mapping
        As in study.json.
    where : mapping of str to tuple
        Values that a row must have, by column; empty for all rows.
    """

    folder: Path
    study: Mapping[str, Any]
    where: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)

    @classmethod
    def load(cls, folder: str | Path) -> Self:
        """Return all results in a folder, of a study that is finished or not.

        Raises
        ------
        StudyError
            If it is not the folder of a study.
        """
        return cls(Path(folder), read_study(Path(folder)))

    @property
    def axes(self) -> tuple[str, ...]:
        """Swept keys."""
        return tuple(self.study["axes"])

    def select(self, where: Mapping[str, Any]) -> Results:
        """Return those rows whose columns have these values; a list means one of them.

        Examples: ``{"method": "relocate"}``, ``{"fault[0].factor": [1.1, 1.5]}``.

        Raises
        ------
        StudyError
            If there is no such column.
        """
        known = [*COLUMNS, *self.axes]
        for column in where:
            if column not in known:
                raise StudyError(unknown("column", column, known))
        wanted = {
            column: tuple(value) if isinstance(value, list | tuple | set) else (value,)
            for column, value in where.items()
        }
        return replace(self, where={**self.where, **wanted})

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the rows as they were written."""
        for path in files.row_files(self.folder):
            for row in files.read(path):
                if not self.where or self._chosen(row):
                    yield row

    def lines(self) -> Iterator[dict[str, Any]]:
        """Yield the rows as lines of a table, with the columns of docs/studies.md and the axes."""
        return (flat(row, self.axes) for row in self.rows())

    def failures(self) -> list[dict[str, Any]]:
        """Return the rows of the cases that could not be run; `error` says why."""
        return [row for row in self.rows() if row["error"] is not None]

    def values(self) -> dict[str, list[Any]]:
        """Return the values found on each axis, in order."""
        found: dict[str, dict[str, Any]] = {axis: {} for axis in self.axes}
        for row in self.rows():
            for axis, value in row["axes"].items():
                found[axis].setdefault(repr(value), value)
        ordered: dict[str, list[Any]] = {}
        for axis, seen in found.items():
            number = axis_kind(seen.values()) == "number"
            ordered[axis] = sorted(seen.values()) if number else list(seen.values())
        return ordered

    def pooled(
        self,
        by: Sequence[str] | None = None,
        *,
        bins: Mapping[str, Sequence[float]] | None = None,
    ) -> list[dict[str, Any]]:
        """Return scores over all rows that agree in some columns, with 95 % intervals.

        Parameters
        ----------
        by : sequence of str, optional
            Columns to tell apart, such as ``["method", "fault[0].factor"]``; scenario, estimator
            and all axes by default. Parameters, and rows with and without a change, are always
            told apart.
        bins : mapping of str to sequence of float, optional
            Edges between which the values of an axis count as one, the middle of the two.

        Returns
        -------
        list of dict
            The columns of `by`, and the scores as in a summary.json; `cases` is their number,
            `lag_bound` the mean of the bound, `hours` how long the simulated axis moved, and
            `false_alarms_per_hour` is of the findings.
        """
        by = ["base", "method", *self.axes] if by is None else list(by)
        held: dict[str, tuple[dict[str, Any], array[float]]] = {}
        for row in self.rows():
            if row["error"] is None:
                key = {c: _value(row, c) for c in (*by, "parameter", "changed")}
                key |= {axis: _middle(key[axis], edges) for axis, edges in (bins or {}).items()}
                _, values = held.setdefault(repr(key), (key, array("d")))
                values.extend(_numbers(row))
        return [_pooled(key, values) for key, values in held.values()]

    def table(self) -> pandas.DataFrame:
        """Return a pandas DataFrame: a line a row, columns as in docs/studies.md, then the axes.

        Raises
        ------
        StudyError
            If pandas is not installed.
        """
        pd = needed("pandas")
        lines = pd.DataFrame(list(self.lines()), columns=[*COLUMNS, *self.axes])
        for axis in self.axes:
            if axis_kind(v for v in lines[axis] if v is not None) != "number":
                lines[axis] = lines[axis].map(as_text)
        return lines

    def to_xarray(self) -> xarray.Dataset:
        """Return an xarray Dataset of the numbers over base, estimator, axes, seed and parameter.

        Swept options of estimators are coordinates on `estimator`. Where the axes are not a
        product (design list or sobol), the dimensions are base, method, point, seed and
        parameter, and all axes are coordinates on `point`. What was not run is NaN.

        Raises
        ------
        StudyError
            If xarray or pandas is not installed.
        """
        needed("xarray")
        table = self.table()
        table = table[table["error"].isna()]
        options = [a for a in self.axes if is_option(a, tuple(self.study["estimators"]))]
        inner = [a for a in self.axes if a not in options]
        runs = table[["estimator", *inner]].drop_duplicates()
        if math.prod(runs[column].nunique() for column in runs) <= 2 * len(runs):  # a product
            told = table[["estimator", "method", *options]].drop_duplicates("estimator")
            return _cube(table, ["base", "estimator", *inner], told)
        told = table[list(self.axes)].drop_duplicates().assign(point=lambda t: range(len(t)))
        return _cube(table.merge(told, on=list(self.axes)), ["base", "method", "point"], told)

    def _chosen(self, row: Mapping[str, Any]) -> bool:
        return all(_value(row, column) in values for column, values in self.where.items())


def _cube(table: pandas.DataFrame, keys: list[str], told: pandas.DataFrame) -> xarray.Dataset:
    """Return the numbers of a table over some of its columns, and what is told of one of them."""
    numbers = [c for c, kind in COLUMNS.items() if kind in {"number", "truth"}]
    found = table.set_index([*keys, "seed", "parameter"])[numbers].astype(float).to_xarray()
    along = next(key for key in keys if key in told)
    told = told.set_index(along).loc[found[along].to_numpy()]
    return found.assign_coords({name: (along, told[name].to_numpy()) for name in told})


def needed(package: str) -> Any:
    """Return an optional package, or say how to install it.

    Raises
    ------
    StudyError
        If it is not installed.
    """
    from importlib import import_module

    try:
        return import_module(package)
    except ImportError as error:
        raise StudyError(f"this needs {package}: python -m pip install {package}") from error


def _value(row: Mapping[str, Any], column: str) -> Any:
    if column in row["axes"]:
        return row["axes"][column]
    table, _, key = column.partition(".")
    value = row.get(table)
    return value.get(key) if key and isinstance(value, dict) else value


def _numbers(row: Mapping[str, Any]) -> Iterator[float]:
    alarms = row["detection"] or {}
    given = [row[name] for name in _PLAIN] + [alarms.get(name) for name in ALARMS]
    given += [row["cost"]["us_per_sample"], row["seconds"]]
    return (math.nan if value is None else float(value) for value in given)


def _pooled(key: Mapping[str, Any], values: array[float]) -> dict[str, Any]:
    width = len(_PLAIN) + len(ALARMS) + 2
    table = np.frombuffer(values).reshape(-1, width)
    rows = [_row(key, [None if np.isnan(v) else v for v in line.tolist()]) for line in table]
    scores = {k: v for k, v in pool_rows(rows, period=PERIOD).items() if k not in _LEFT_OUT}
    found = [row["detection"] for row in rows if row["detection"]]
    hours = float(table[:, -1].sum() / 3600)
    return {
        **key,
        "cases": len(rows),
        **scores,
        "false_alarms_per_hour": sum(f["false_alarms"] for f in found) / hours if found else None,
        "hours": hours,
    }


def _middle(value: float | None, edges: Sequence[float]) -> float | None:
    """Return the middle of the two edges between which a value lies."""
    if value is None:
        return None
    place = min(max(int(np.searchsorted(edges, value, side="right")), 1), len(edges) - 1)
    return float((edges[place - 1] + edges[place]) / 2)


def _row(key: Mapping[str, Any], line: Sequence[float | None]) -> dict[str, Any]:
    """Return a row as `pool_rows` reads it."""
    alarms = dict(zip(ALARMS, line[len(_PLAIN) :], strict=False))
    plain = dict(zip(_PLAIN, line, strict=False))
    return {
        "scenario": None,
        "hash": None,
        "estimator": None,
        **key,
        **plain,
        **{name: None if plain[name] is None else bool(plain[name]) for name in _TRUTHS},
        "detection": None if alarms["alarms"] is None else alarms,
        "cost": {"us_per_sample": line[-2]},
    }
