"""The results in a folder, in Python: rows, selections, pooled scores, tables, a labelled cube."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.experiments.results.export import cube_of, export_csv, export_parquet, frame
from flexaxis.experiments.results.groups import APART, Bins, Groups, grouped, middle, place_of
from flexaxis.experiments.results.source import ALL, Condition, Source, asked, having
from flexaxis.experiments.running.folder import read_study
from flexaxis.experiments.running.study import find_point, is_option
from flexaxis.experiments.scoring.score_definition import Kind
from flexaxis.experiments.scoring.summary import POOLED
from flexaxis.experiments.storage.files import StudyError
from flexaxis.experiments.storage.schema import CASE, COLUMNS, axis_kind
from flexaxis.sim.errors import unknown
from flexaxis.sim.scenario import Scenario, scenario_from

if TYPE_CHECKING:
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
    _more: Condition = field(default=ALL, repr=False)
    _shared: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

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
    def source(self) -> Source:
        """The file of the rows, as it was when it was first asked for."""
        if "source" not in self._shared:
            self._shared["source"] = Source(self.folder)
        found: Source = self._shared["source"]
        return found

    @property
    def rows(self) -> Rows:
        """The rows as lines of a table: dicts, with the columns of docs/studies.md and the axes.

        They can be gone through again and again, and ``len(results.rows)`` is their number.
        """
        return Rows(self)

    def __len__(self) -> int:
        """Return the number of rows."""
        ((count,),) = self.source.lines(["count(*)"], self._condition)
        return int(count)

    def select(self, where: Mapping[str, Any]) -> Self:
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

    def having(self, more: Condition) -> Self:
        """Return those rows of which something more is true."""
        return replace(self, _more=self._more & more)

    @property
    def _condition(self) -> Condition:
        found = asked(self.study) & self._more
        for column, values in self.where.items():
            found &= having(column, values, self.axes)
        return found

    def ran(self) -> Self:
        """Return those that have scores: all but those of records that nobody can make.

        A case that failed is among them, as a run lost at its first sample.
        """
        return self.having(Condition("cells.parameter > 0"))

    def failures(self) -> list[Line]:
        """Return the first row of each case that failed; `error` says why."""
        found: dict[str, Line] = {}
        for row in self.having(Condition("cells.error > 0")).rows:
            found.setdefault(row["case"], row)
        return list(found.values())

    @property
    def cases(self) -> int:
        """Number of cases, those that could not be run among them."""
        return len(np.unique(self.column(CASE)))

    def values(self) -> dict[str, list[Any]]:
        """Return the values found on each axis: numbers in order, others as they came."""
        found = {}
        for axis in self.axes:
            there = pd.unique(self.column("axes")).tolist()
            every = [self.source.value(axis, each) for each in there]
            seen = list({repr(value): value for value in every if value is not None}.values())
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
        names = list(dict.fromkeys([*by, *([] if cases else APART)]))
        return grouped(self.ran(), names, bins=bins, cases=cases)

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
        return self.grouped(by, bins=bins).pooled(POOLED if scores is None else scores)

    def column(self, name: str) -> NDArray[Any]:
        """Return a column as it is stored."""
        return self.at(name, slice(None))

    def at(self, name: str, rows: Any) -> NDArray[Any]:
        """Return a column as it is stored, in some rows."""
        places = self._places
        return self.source.column(name)[rows if places is None else places[rows]]

    def numbers(self, name: str, rows: Any) -> NDArray[np.float64]:
        """Return a column of numbers or truths in some rows; NaN where it is not defined."""
        found = self.at(name, rows)
        return found if found.dtype == np.float64 else np.where(found < 0, np.nan, found)

    @cached_property
    def _places(self) -> NDArray[np.int64] | None:
        """Where the rows lie among all of the folder; None for all of them."""
        return self.source.places(self._condition)

    def codes(
        self, name: str, edges: Sequence[float] | None = None
    ) -> tuple[NDArray[np.intp], list[Any]]:
        """Return the place of the value of each row among those of a column, and these in order.

        Numbers and parameters are in their order, other texts in that of the alphabet, unless the
        study has another; what is not defined comes first.

        Parameters
        ----------
        name : str
        edges : sequence of float, optional
            Between which values count as one, the middle of the two.
        """
        stored = self.column("axes" if name in self.axes else name)
        places, there = pd.factorize(stored, use_na_sentinel=False)
        values = [middle(self.source.value(name, each), edges) for each in there.tolist()]
        every = {repr(value): value for value in values}
        order = {
            "base": [entry["definition"]["name"] for entry in self.study.get("scenarios", ())],
            "method": list(self.study.get("estimators", ())),
        }.get(name, [])
        ordered = sorted(every, key=lambda text: place_of(name, every[text], order))
        number = {text: i for i, text in enumerate(ordered)}
        lookup = np.array([number[repr(value)] for value in values], np.intp)
        return lookup[places] if len(lookup) else places, [every[text] for text in ordered]

    def scenario(self, row: int) -> Scenario | None:
        """Return the scenario of a row; None where study.json does not tell it."""
        if "bases" not in self._shared:
            self._shared["bases"] = [
                scenario_from(entry["definition"], source=entry["definition"]["name"])
                for entry in self.study.get("scenarios", ())
            ]
        axes, key = (self.source.texts[int(self.column(n)[row])] for n in ("axes", "hash"))
        options = tuple(self.study.get("estimators", ()))
        swept = {k: v for k, v in self.source.axes(axes).items() if not is_option(k, options)}
        found = find_point(self._shared["bases"], swept, str(key))
        return None if found is None else found.scenario()

    @property
    def kinds(self) -> dict[str, Kind]:
        """The kind of each column, the axes last."""
        return {**COLUMNS, **{axis: axis_kind(values) for axis, values in self.values().items()}}

    def to_dataframe(self) -> pd.DataFrame:
        """Return a pandas DataFrame: a line a row, columns as in docs/studies.md, then the axes."""
        kinds = self.kinds
        return pd.concat([frame(part, kinds) for part in self.parts()] or [frame({}, kinds)],
                         ignore_index=True)  # fmt: skip

    def to_xarray(self) -> xarray.Dataset:
        """Return an xarray Dataset: the numbers over scenario, estimator, axes, seed, parameter.

        Raises
        ------
        StudyError
            If xarray is not installed.
        """
        return cube_of(self).to_xarray()

    def to_csv(self, path: str | Path) -> int:
        """Write the rows as a CSV file with a header; return their number.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        return export_csv(self, Path(path))

    def to_parquet(self, path: str | Path) -> int:
        """Write the rows as a compressed Parquet file; return their number.

        Raises
        ------
        OutputError
            If the file cannot be written.
        StudyError
            If pyarrow is not installed.
        """
        return export_parquet(self, Path(path))

    def parts(self, columns: Sequence[str] = ()) -> Iterator[dict[str, list[Any]]]:
        """Yield columns as Python values, all or some, of so many rows as are held in memory."""
        names = list(columns or [*COLUMNS, *self.axes])
        yield from self.source.parts(names, self._condition)

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
        for part in self.results.parts(self.columns):
            for line in zip(*part.values(), strict=True):
                yield dict(zip(part, line, strict=True))

    def __len__(self) -> int:
        """Return their number."""
        return len(self.results)
