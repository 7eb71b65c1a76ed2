"""Results as tables: rows as a DataFrame, scores pooled over seeds, xarray, CSV, Parquet."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import pandas as pd

from flexaxis.experiments.files import (
    SUMMARY,
    StudyError,
    new_file,
    optional_package,
    read_json,
)
from flexaxis.experiments.running.case import NUMBERS
from flexaxis.experiments.running.store import Store
from flexaxis.experiments.running.study import is_option
from flexaxis.experiments.scoring import summary
from flexaxis.experiments.scoring.pooling import Columns
from flexaxis.experiments.scoring.score_table import columns as score_columns
from flexaxis.experiments.scoring.summary import Case
from flexaxis.sim.errors import unknown
from flexaxis.sim.scenario import Scenario, scenario_from

if TYPE_CHECKING:
    import xarray

Part = tuple[dict[str, Any], pd.DataFrame]
"""Values that some rows have in common, and the rows."""
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
        table = self._store.frame(self._variants)
        if "variants" in self.study:
            table = table[table["seed"].isin(self.study["seeds"])].reset_index(drop=True)
        axes = dict.fromkeys(key for about in self._variants.values() for key in about["axes"])
        for key in axes:
            table[key] = [_plain(point.get(key)) for point in table["axes"]]
        return table[[*FIRST, *axes, *score_columns(), *LAST]]

    @cached_property
    def _variants(self) -> dict[int, dict[str, Any]]:
        """What the cases of each estimator on each scenario share, in the order of the rows."""
        every = self._store.variants()
        if "variants" not in self.study:
            return every
        labels = {_key(label): label for label in self.study["variants"]}
        order = {key: place for place, key in enumerate(labels)}
        known = [(number, about) for number, about in every.items() if _key(about) in labels]
        known.sort(key=lambda pair: order[_key(pair[1])])
        return {number: about | labels[_key(about)] for number, about in known}

    def to_dataframe(self) -> pd.DataFrame:
        """Return `frame`."""
        return self.frame

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

    def groups(self, *by: str) -> Iterator[Part]:
        """Yield the rows that agree in some columns, group by group, in the order of the values.

        Column ``point`` tells the settings on the scenarios apart.

        Parameters
        ----------
        *by : str

        Raises
        ------
        StudyError
            If there is no such column.
        """
        for name in by:
            if name not in self.frame:
                raise StudyError(unknown("column", name, self.frame.columns))
        keys = self.frame[[*dict.fromkeys(("seed", "case", "parameter", *by))]]
        keys = keys[keys["parameter"] != ""].sort_values(["seed", "case"])
        points = self.frame.groupby(["hash", "setting"], sort=False).ngroup()
        parts = keys.groupby([_ordered(keys[name]) for name in by], observed=True, dropna=False)
        for values, part in parts:
            key = {name: _value(value) for name, value in zip(by, values, strict=True)}
            yield key, self.frame.loc[part.index].assign(point=points)

    def scores(self, *by: str, scores: Sequence[str] | None = None) -> pd.DataFrame:
        """Return `pooled` as a DataFrame."""
        return pd.DataFrame(self.pooled(*by, scores=scores))

    def pooled(self, *by: str, scores: Sequence[str] | None = None) -> list[dict[str, Any]]:
        """Return scores pooled over the rows that agree in some columns, with 95 % intervals.

        Parameters
        ----------
        *by : str
            Columns to tell apart; scenario, estimator and all axes by default. Parameters, and
            rows with and without a change, are always told apart.
        scores : sequence of str, optional
            Which scores to pool; all by default.

        Returns
        -------
        list of dict
            The columns of `by`, ``parameter, changed, runs, seeds``, and the scores as in
            summary.json. The excess error is that of one scenario, and is None where rows of
            several are pooled.

        Raises
        ------
        StudyError
            If there is no such column or score.
        """
        names = by or ("scenario", "estimator", *self.axes)
        wanted = dict.fromkeys(("failed", *(summary.POOLED if scores is None else scores)))
        for score in wanted:
            if score not in summary.POOLED:
                raise StudyError(unknown("score", score, summary.POOLED))
        keys, lines = dict.fromkeys([*names, "parameter", "changed"]), list[dict[str, Any]]()
        for _, group in groupby(self.groups(*keys), lambda pair: [pair[0][name] for name in names]):
            parts = list(group)
            every = [_columns(part) for _, part in parts]
            shared = self._excess(parts, every) if "excess" in wanted else {}
            for (key, part), columns in zip(parts, every, strict=True):
                line = key | {"runs": len(part), "seeds": int(part["seed"].nunique())}
                line |= summary.pool_columns(columns, wanted) | summary.cost(columns)
                lines.append(line | shared)
        return lines

    def _excess(self, parts: Sequence[Part], every: Sequence[Columns]) -> dict[str, Any]:
        """Return the excess error, which all parameters of a group share."""
        if len({point for columns in every for point in columns["point"]}) == 1:
            scenario = self.scenario(parts[0][1].iloc[0])
            by_name = {key["parameter"]: own for (key, _), own in zip(parts, every, strict=True)}
            asked = {n: v for n, v in by_name.items() if n in scenario.identify} or by_name
            if len({v["seed"].tobytes() for v in asked.values()}) == 1:  # of the same cases
                return summary.excess(asked, scenario)
        return {"excess": None, "excess_interval": None}

    def scenario(self, row: Mapping[str, Any]) -> Scenario:
        """Return the scenario of a row of `frame`, at its point of the sweep."""
        definitions = (entry["definition"] for entry in self.study["scenarios"])
        definition = next(each for each in definitions if each["name"] == row["scenario"])
        base = scenario_from(definition, source=str(row["scenario"]))
        point = next(v["axes"] for v in self._variants.values() if v["hash"] == row["hash"])
        options = self.study["estimators"]
        axes = {key: value for key, value in point.items() if not is_option(key, options)}
        return base.override(axes, inherit=self.study["streams"] == "common") if axes else base

    def traces(self, scenario_hash: str, setting: str) -> dict[int, Case]:
        """Return what the figures of single runs need, by seed.

        Parameters
        ----------
        scenario_hash, setting : str
            As in the columns ``hash`` and ``setting`` of `frame`.
        """
        known = self._store.traces(scenario_hash, setting)
        seeds = {*self.study.get("seeds", known)}
        return {seed: trace for seed, trace in known.items() if seed in seeds}

    @property
    def summary(self) -> Any:
        """What summary.json says.

        Raises
        ------
        OutputError
            If it is missing: the run is not finished.
        """
        return read_json((self.folder or Path()) / SUMMARY)

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


def _value(value: Any) -> Any:
    """Return a value of a group as one of Python, None where it is missing."""
    return None if pd.isna(value) else getattr(value, "item", lambda: value)()


def _key(about: Mapping[str, Any]) -> tuple[Any, ...]:
    return about["hash"], about["setting"], about["code"]


def _plain(value: Any) -> Any:
    """Return the value of an axis as a cell: a number, a text, or JSON."""
    return value if value is None or isinstance(value, int | float | str) else json.dumps(value)


def _ordered(values: pd.Series) -> Any:
    """Return the groups of a column: numbers in order, texts as they came."""
    if pd.api.types.is_numeric_dtype(values):
        return values
    return pd.Categorical(values, categories=values.dropna().unique())


def _columns(part: pd.DataFrame) -> Columns:
    return {name: part[name].to_numpy(float) for name in ("seed", "point", *NUMBERS)}
