"""The results in a folder, in Python: rows, selections, pooled scores, tables, a labelled cube."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.results.columnar import PART, Index, Table, asked_of, open_table
from flexaxis.experiments.results.groups import APART, Bins, Groups, grouped
from flexaxis.experiments.running.axes import is_option
from flexaxis.experiments.running.columns import COLUMNS, as_text, axis_kind
from flexaxis.experiments.running.errors import StudyError
from flexaxis.experiments.running.folder import read_study
from flexaxis.experiments.running.units import find_point
from flexaxis.experiments.scoring.pooling import POOLED
from flexaxis.sim.errors import unknown
from flexaxis.sim.scenario import Scenario, stored_scenario

if TYPE_CHECKING:
    import pandas
    import xarray

Line = dict[str, Any]


@dataclass(frozen=True)
class Results:
    """The rows in a folder that were asked for last, all or some of them; read when needed.

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
    _held: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def load(cls, folder: str | Path, *, whole: bool = False) -> Self:
        """Return what a folder holds of what was asked for last, finished or not.

        Parameters
        ----------
        folder : str or Path
        whole : bool
            Whether to return also what was asked for before.

        Raises
        ------
        StudyError
            If it holds none.
        """
        study = read_study(Path(folder), whole=whole)
        return cls(Path(folder), {k: v for k, v in study.items() if not (whole and k == "asked")})

    @property
    def axes(self) -> tuple[str, ...]:
        """Swept keys."""
        return tuple(self.study["axes"])

    @property
    def table(self) -> Table:
        """The columns of the folder, as they were when they were first asked for."""
        if "table" not in self._held:
            self._held["table"] = open_table(self.folder, self.axes)
        table: Table = self._held["table"]
        return table

    @property
    def rows(self) -> Rows:
        """The rows as lines of a table: dicts, with the columns of docs/studies.md and the axes.

        They can be gone through again and again, and ``len(results.rows)`` is their number.
        """
        return Rows(self)

    def select(self, where: Mapping[str, Any]) -> Results:
        """Return those rows whose columns have these values; a list means one of them.

        Examples: ``{"method": "glr"}``, ``{"fault[0].factor": [1.1, 1.5]}``.

        Raises
        ------
        StudyError
            If there is no such column.
        """
        self._check(where)
        wanted = {
            column: tuple(value) if isinstance(value, list | tuple | set) else (value,)
            for column, value in where.items()
        }
        return replace(self, where={**self.where, **wanted})

    def chosen(self) -> NDArray[np.bool_]:
        """Return which rows of the table are selected (n,)."""
        if "asked" not in self._held:
            self._held["asked"] = asked_of(self.table, self.study)
        found: NDArray[np.bool_] = self._held["asked"].copy()
        for column, values in self.where.items():
            found &= self.table.among(column, values)
        return found

    def ran(self) -> NDArray[np.bool_]:
        """Return which of them have scores (n,): all but those of records that nobody can make.

        A case that failed is among them, as a run lost at its first sample.
        """
        return self.chosen() & (self.table.raw("parameter") >= 0)

    def failures(self) -> list[Line]:
        """Return the first row of each case that failed; `error` says why."""
        rows = np.flatnonzero(self.chosen() & (self.table.raw("error") >= 0))
        _, first = np.unique(self.table.raw("case")[rows], return_index=True)
        return list(self.lines(rows[np.sort(first)]))

    @property
    def cases(self) -> int:
        """Number of cases, those that could not be run among them."""
        return len(np.unique(self.table.raw("case")[self.chosen()]))

    def values(self) -> dict[str, list[Any]]:
        """Return the values found on each axis: numbers in order, others as they came."""
        chosen, found = self.chosen(), {}
        for axis in self.axes:
            there = np.unique(self.table.raw(axis)[chosen])
            seen = [self.table.texts(axis)[code] for code in there if code >= 0]
            found[axis] = sorted(seen) if axis_kind(seen) == "number" else seen
        return found

    def grouped(
        self,
        by: Sequence[str] | None = None,
        *,
        bins: Bins | None = None,
        cases: bool = False,
    ) -> Groups:
        """Return the rows that have scores, group by group, as `pooled` pools them.

        With `cases` they are one of each case, and no parameters are told apart: for what is the
        same in all rows of a case.
        """
        by = ["base", "method", *self.axes] if by is None else by
        self._check(by)
        order = {
            "base": [entry["definition"]["name"] for entry in self.study.get("scenarios", ())],
            "method": list(self.study.get("estimators", ())),
        }
        names, chosen = list(dict.fromkeys([*by, *([] if cases else APART)])), self.ran()
        if cases:
            rows = np.flatnonzero(chosen)
            case = self.table.raw("case")[rows]  # rows of a case follow each other
            chosen[rows[1:][case[1:] == case[:-1]]] = False
        return grouped(self.table, names, chosen=chosen, bins=bins, order=order)

    def pooled(
        self,
        by: Sequence[str] | None = None,
        *,
        bins: Bins | None = None,
        scores: Sequence[str] | None = None,
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
        scores : sequence of str, optional
            Which scores to pool; all by default.

        Returns
        -------
        list of dict
            The columns of `by`, in the order of their values, and the scores as in a summary.json;
            `cases` is their number, `lag_bound` the mean of the bound, `hours` how long the
            simulated axis moved, and `false_alarms_per_hour` is of the findings. The excess error
            is that of one scenario: where rows of several are pooled it is None.

        Raises
        ------
        StudyError
            If there is no such column or score.
        """
        for score in scores or ():
            if score not in POOLED:
                raise StudyError(unknown("score", score, POOLED))
        groups = self.grouped(by, bins=bins)
        return groups.pooled(POOLED if scores is None else scores, self.scenario)

    def scenario(self, row: int) -> Scenario | None:
        """Return the scenario of a row of the table; None where study.json does not tell it."""
        names = ("base", "hash", *self.axes)
        line = {name: self.table.values(name, np.array([row]))[0] for name in names}
        if "bases" not in self._held:
            self._held["bases"] = [
                stored_scenario(entry["definition"], source=entry["definition"]["name"])
                for entry in self.study.get("scenarios", ())
            ]
        swept = {axis: line[axis] for axis in self.axes if not self._is_option(axis)}
        found = find_point(self._held["bases"], swept, line["hash"])
        return None if found is None else found.scenario()

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas DataFrame: a line a row, columns as in docs/studies.md, then the axes.

        Raises
        ------
        StudyError
            If pandas is not installed.
        """
        pd = needed("pandas")
        rows, found = np.flatnonzero(self.chosen()), {}
        for name, kind in self.table.kinds.items():
            if kind == "number":
                found[name] = self.table.numbers(name, rows)
            else:
                values = self.table.values(name, rows)
                if kind == "text":
                    values = [as_text(value) for value in values]
                dtype = {"text": object, "truth": "boolean", "integer": "Int64"}[kind]
                found[name] = pd.array(values, dtype=dtype)
        return pd.DataFrame(found)

    def to_xarray(self) -> xarray.Dataset:
        """Return an xarray Dataset: the numbers over scenario, estimator, axes, seed, parameter.

        It is the cube of `flexaxis.experiments.results.cube`, as `flexaxis export --netcdf` writes
        it.

        Raises
        ------
        StudyError
            If xarray is not installed.
        """
        from flexaxis.experiments.results.cube import cube_of

        return cube_of(self).to_xarray(needed("xarray"))

    def parts(self) -> Iterator[Index]:
        """Yield the selected rows of the table, as many at a time as are held in memory."""
        chosen = self.chosen()
        for start in range(0, len(chosen), PART):
            rows = start + np.flatnonzero(chosen[start : start + PART])
            if rows.size:
                yield rows

    def lines(self, rows: Index, columns: Sequence[str] = ()) -> Iterator[Line]:
        """Yield some rows of the table, in increasing order, with all or some columns."""
        names = columns or [*COLUMNS, *self.axes]
        values = [self.table.values(name, rows) for name in names]
        return (dict(zip(names, line, strict=True)) for line in zip(*values, strict=True))

    def _is_option(self, axis: str) -> bool:
        return is_option(axis, tuple(self.study.get("estimators", ())))

    def _check(self, columns: Iterator[str] | Sequence[str] | Mapping[str, Any]) -> None:
        known = [*COLUMNS, *self.axes]
        for column in columns:
            if column not in known:
                raise StudyError(unknown("column", column, known))


@dataclass(frozen=True)
class Rows:
    """The selected rows of results, one at a time."""

    results: Results
    columns: Sequence[str] = ()  # all where none are named

    def __iter__(self) -> Iterator[Line]:
        """Yield the rows."""
        for rows in self.results.parts():
            yield from self.results.lines(rows, self.columns)

    def __len__(self) -> int:
        """Return their number."""
        return int(self.results.chosen().sum())


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
