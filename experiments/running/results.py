"""Results as tables: rows as a DataFrame, scores pooled over seeds, xarray, CSV, Parquet."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pandas as pd

from flexaxis.experiments.files import (
    SUMMARY,
    OutputError,
    StudyError,
    json_table,
    new_file,
    optional_package,
)
from flexaxis.experiments.running.case import NUMBERS
from flexaxis.experiments.running.store import Store
from flexaxis.experiments.running.study import is_option
from flexaxis.experiments.scoring import summary
from flexaxis.experiments.scoring.intervals import rate_interval
from flexaxis.experiments.scoring.pooling import Columns
from flexaxis.experiments.scoring.score_table import columns as score_columns
from flexaxis.experiments.scoring.summary import Case
from flexaxis.sim.errors import unknown
from flexaxis.sim.scenario import Scenario, scenario_from

if TYPE_CHECKING:
    import xarray

FIRST = ("scenario", "estimator", "seed", "parameter", "changed")
LAST = ("onset", "seconds", "error", "setting", "hash", "case", "cost.us_per_sample",
        "cost.seconds", "cost.host")  # fmt: skip


class Results:
    """The cases of a study.

    Parameters
    ----------
    store : Store
    study : mapping
        As from `describe`; without its ``variants`` all cases are meant.

    Attributes
    ----------
    folder : Path or None
    """

    def __init__(self, store: Store, study: Mapping[str, Any]) -> None:
        self._store, self.study, self.folder = store, dict(study), store.folder

    @classmethod
    def load(cls, folder: str | Path, *, whole: bool = False) -> Self:
        """Return what a folder holds of the study that was asked for last.

        Parameters
        ----------
        folder : str or Path
        whole : bool
            Whether to return what was asked for before, too.

        Raises
        ------
        StudyError
            If it holds no rows.
        """
        store = Store.read(Path(folder))
        study = store.study or {"name": Path(folder).name, "axes": [], "scenarios": []}
        return cls(store, {k: v for k, v in study.items() if not (whole and k == "variants")})

    @property
    def axes(self) -> tuple[str, ...]:
        """Swept keys."""
        return tuple(self.study["axes"])

    @cached_property
    def frame(self) -> pd.DataFrame:
        """All rows, a line a case and parameter; the columns that matter most come first."""
        every = self._store.variants()
        if (asked := self.study.get("variants")) is not None:
            labels = {_key(label): (place, label) for place, label in enumerate(asked)}
            known = [(*labels[_key(about)], number, about) for number, about in every.items()
                     if _key(about) in labels]  # fmt: skip
            known.sort(key=lambda each: (each[0], each[2]))
            every = {number: about | label for _, label, number, about in known}
        table = self._store.frame(every)
        if asked is not None:
            table = table[table["seed"].isin(self.study["seeds"])].reset_index(drop=True)
        axes = {
            key: [_plain(point.get(key)) for point in table["axes"]]
            for key in dict.fromkeys(key for about in every.values() for key in about["axes"])
        }
        table = table.assign(**axes)
        return table[[*FIRST, *axes, *score_columns(), *LAST]]

    @property
    def made_with(self) -> dict[str, str]:
        """Versions and digest of the code that made the rows."""
        return self._store.made_with

    def to_dataframe(self) -> pd.DataFrame:
        """Return `frame`."""
        return self.frame

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def cases(self) -> int:
        """Number of cases, failed ones included."""
        return int(self.frame["case"].nunique())

    @property
    def failures(self) -> pd.DataFrame:
        """The cases that failed: scenario, estimator, setting, seed, error."""
        failed = self.frame[self.frame["error"].notna()].drop_duplicates("case")
        names = ["scenario", "estimator", "setting", "seed", "error"]
        return failed[names].reset_index(drop=True)

    def select(self, where: Mapping[str, Any]) -> Self:
        """Return the rows whose columns have these values; a list means one of them.

        Raises
        ------
        StudyError
            If there is no such column.
        """
        self._check(where)
        kept = pd.Series(True, self.frame.index)
        for name, value in where.items():
            values = value if isinstance(value, list | tuple | set) else [value]
            kept &= self.frame[name].isin(list(values))
        found = type(self)(self._store, self.study)
        found.__dict__["frame"] = self.frame[kept].reset_index(drop=True)
        return found

    def groups(
        self, *by: str, bins: Mapping[str, Sequence[float]] | None = None
    ) -> list[tuple[dict[str, Any], pd.DataFrame]]:
        """Return the rows that agree in some columns, group by group, in the order of the values.

        Parameters
        ----------
        *by : str
        bins : mapping of str to sequence of float, optional
            Edges between which the values of an axis count as one, the middle of the two.

        Raises
        ------
        StudyError
            If there is no such column.
        """
        self._check(by)
        table = self.frame[self.frame["parameter"] != ""].sort_values(["seed", "case"])
        table["point"] = table.groupby(["hash", "setting"], sort=False).ngroup()
        keys = [_ordered(table[name], (bins or {}).get(name)) for name in by]
        parts = table.groupby(keys, observed=True, dropna=False)
        return [({name: _value(value) for name, value in zip(by, key, strict=True)}, part)
                for key, part in parts]  # fmt: skip

    def scores(
        self, *by: str, scores: Sequence[str] | None = None,
        bins: Mapping[str, Sequence[float]] | None = None,
    ) -> pd.DataFrame:  # fmt: skip
        """Return `pooled` as a DataFrame."""
        return pd.DataFrame(self.pooled(*by, scores=scores, bins=bins))

    def pooled(
        self, *by: str, scores: Sequence[str] | None = None,
        bins: Mapping[str, Sequence[float]] | None = None,
    ) -> list[dict[str, Any]]:  # fmt: skip
        """Return scores pooled over the rows that agree in some columns, with 95 % intervals.

        Parameters
        ----------
        *by : str
            Columns to tell apart; scenario, estimator and all axes by default. Parameters, and
            rows with and without a change, are always told apart.
        scores : sequence of str, optional
            Which scores to pool; all by default.
        bins : mapping, optional
            As for `groups`.

        Returns
        -------
        list of dict
            The columns of `by`, ``parameter, changed, runs, seeds``, the scores as in summary.json,
            ``hours`` of simulated time and ``false_alarms_per_hour``. The excess error is that of
            one scenario, and is None where rows of several are pooled.

        Raises
        ------
        StudyError
            If there is no such column or score.
        """
        for score in scores or ():
            if score not in summary.POOLED:
                raise StudyError(unknown("score", score, summary.POOLED))
        names = by or ("scenario", "estimator", *self.axes)
        keys = dict.fromkeys([*names, "parameter", "changed"])
        wanted = dict.fromkeys(("failed", *(summary.POOLED if scores is None else scores)))
        lines, every = [], []
        for key, part in self.groups(*keys, bins=bins):
            columns = _Columns(part)
            line = key | {"runs": len(part), "seeds": int(part["seed"].nunique())}
            line |= summary.pool_columns(columns, wanted)
            lines.append(line | summary.cost(columns) | _alarms(part, line))
            every.append(columns)
        if "excess" in wanted:
            self._add_excess(lines, every, names)
        return lines

    def _add_excess(
        self, lines: list[dict[str, Any]], every: Sequence[Columns], names: Sequence[str]
    ) -> None:
        """Add the excess error, which all parameters of a group share."""
        together: dict[str, list[tuple[dict[str, Any], Columns]]] = {}
        for line, values in zip(lines, every, strict=True):
            line |= {"excess": None, "excess_interval": None}
            key = json.dumps([str(line[name]) for name in names])
            together.setdefault(key, []).append((line, values))
        for group in together.values():
            if len({point for _, values in group for point in values["point"]}) != 1:
                continue
            scenario = self.scenario(self.frame.loc[int(group[0][1]["row"][0])])
            by_name = {line["parameter"]: values for line, values in group}
            asked = {n: v for n, v in by_name.items() if n in scenario.identify} or by_name
            first = next(iter(asked.values()))["case"]
            if all(np.array_equal(values["case"], first) for values in asked.values()):
                shared = summary.excess(asked, scenario)
                for line, _ in group:
                    line.update(shared)

    def scenario(self, row: Mapping[str, Any]) -> Scenario:
        """Return the scenario of a row of `frame`, at its point of the sweep."""
        known = {entry["definition"]["name"]: entry["definition"]
                 for entry in self.study["scenarios"]}  # fmt: skip
        base = scenario_from(known[row["scenario"]], source=str(row["scenario"]))
        options = self.study["estimators"]
        axes = {key: json.loads(row[key]) if _is_json(row[key]) else row[key]
                for key in self.axes if not is_option(key, options)}  # fmt: skip
        return base.override(axes, inherit=self.study["streams"] == "common") if axes else base

    def traces(self, scenario_hash: str, setting: str) -> dict[int, Case]:
        """Return what the figures of single runs need, by seed.

        Parameters
        ----------
        scenario_hash, setting : str
            As in the columns ``hash`` and ``setting`` of `frame`.
        """
        found = self._store.traces(scenario_hash, setting)
        seeds = {*self.study.get("seeds", found)}
        return {seed: trace for seed, trace in found.items() if seed in seeds}

    @property
    def summary(self) -> dict[str, Any]:
        """What summary.json says.

        Raises
        ------
        OutputError
            If it is missing: the run is not finished.
        """
        return json_table((self.folder or Path()) / SUMMARY, OutputError)

    def to_csv(self, path: str | Path) -> None:
        """Write the rows as CSV; a column that is defined in no row is there and empty."""
        with new_file(Path(path)) as part:
            self.frame.to_csv(part, index=False)

    def to_parquet(self, path: str | Path) -> None:
        """Write the rows as Parquet; needs pyarrow."""
        optional_package("pyarrow")
        with new_file(Path(path)) as part:
            self.frame.to_parquet(part, index=False)

    def to_xarray(self) -> xarray.Dataset:
        """Return the numbers over scenario, estimator, point of the sweep, seed and parameter.

        What was not run or is not defined is NaN. The axes are coordinates of the points:
        ``set_index(point=[...]).unstack("point")`` makes them dimensions.
        """
        axes, table = list(self.axes), self.frame[self.frame["parameter"] != ""]
        points = table.groupby(axes, dropna=False).ngroup() if axes else 0
        table = table.assign(point=points)
        index = ["scenario", "estimator", "point", "seed", "parameter"]
        cube = table.set_index(index)[[*NUMBERS]].astype(float).to_xarray()
        values = table.groupby("point")[axes].first()
        return cube.assign_coords({axis: ("point", values[axis]) for axis in axes})

    def _check(self, names: Iterable[str]) -> None:
        for name in names:
            if name not in self.frame:
                raise StudyError(unknown("column", name, self.frame.columns))


def _value(value: Any) -> Any:
    """Return a value of a group as one of Python, None where it is missing."""
    return None if pd.isna(value) else getattr(value, "item", lambda: value)()


def _key(about: Mapping[str, Any]) -> tuple[Any, ...]:
    return about["hash"], about["setting"], about["code"]


def _plain(value: Any) -> Any:
    """Return the value of an axis as a cell: a number, a text, or JSON."""
    return value if value is None or isinstance(value, int | float | str) else json.dumps(value)


def _is_json(value: Any) -> bool:
    return isinstance(value, str) and value[:1] in {"[", "{"}


def _ordered(values: pd.Series, edges: Sequence[float] | None) -> Any:
    """Return the groups of a column: numbers in order or in bins, texts as they came."""
    if edges is not None:
        place = np.searchsorted(edges, values.to_numpy(float), side="right")
        place = np.clip(place, 1, len(edges) - 1)
        return (np.asarray(edges)[place - 1] + np.asarray(edges)[place]) / 2
    if pd.api.types.is_numeric_dtype(values):
        return values
    return pd.Categorical(values, categories=values.dropna().unique())


class _Columns(dict[str, Any]):
    """Columns of some rows as arrays of numbers, each made when it is first asked for."""

    def __init__(self, part: pd.DataFrame) -> None:
        super().__init__(case=part["case"].to_numpy(), row=part.index.to_numpy())
        self._part = part

    def __missing__(self, name: str) -> Any:
        self[name] = found = self._part[name].to_numpy(float)
        return found


def _alarms(part: pd.DataFrame, pooled: Mapping[str, Any]) -> dict[str, Any]:
    """Return the simulated hours, and the false alarms an hour without a fault."""
    hours = float(part["seconds"].sum() / 3600)
    calm = float(part["detection.calm"].sum() / 3600) or hours
    found: dict[str, Any] = dict.fromkeys(
        ("false_alarms_per_hour", "false_alarms_per_hour_interval")
    )
    if pooled.get("detection") and calm:
        counts = part["detection.false_alarms"].fillna(0.0).to_numpy()
        within = rate_interval(counts, calm, part["seed"].to_numpy(float))
        found = dict(zip(found, (float(counts.sum()) / calm, within), strict=True))
    return found | {"hours": hours}
