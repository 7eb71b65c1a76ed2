"""Provide the results of a study as pooled scores, a DataFrame, a Dataset, CSV or Parquet."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cached_property
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import pandas as pd

from flexaxis.experiments.files import StudyError, new_file
from flexaxis.experiments.running.store import Store
from flexaxis.experiments.scoring import summary
from flexaxis.experiments.scoring.pooling import Columns
from flexaxis.experiments.scoring.score_table import columns as score_columns
from flexaxis.experiments.scoring.summary import Case
from flexaxis.sim.errors import unknown
from flexaxis.sim.scenario import Scenario, scenario_from

if TYPE_CHECKING:
    import xarray

_key = itemgetter("hash", "setting", "code")
FIRST = ("scenario", "estimator", "seed", "parameter", "changed")
LAST = ("onset", "seconds", "error", "setting", "hash", "case", "cost.us_per_sample",
        "cost.seconds")  # fmt: skip


class Results:
    """The results of a study.

    Parameters
    ----------
    store : Store
        Store that contains the scores.
    study : mapping
        Description of the study, as returned by `describe`. If the description lacks the key
        ``variants``, the results include all runs in the store.

    Attributes
    ----------
    folder : Path or None
        Folder of the store, or None if the scores are in memory.
    axes : tuple of str
        Names of the scenario keys and estimator options that the study sweeps.
    """

    def __init__(self, store: Store, study: Mapping[str, Any]) -> None:
        self._store, self.study, self.folder = store, dict(study), store.folder
        self.axes = tuple(study["axes"])

    @classmethod
    def load(cls, folder: str | Path) -> Self:
        """Return the results of the most recent study in a folder.

        Raises
        ------
        StudyError
            If the folder contains no results, or only results of a comparison or of tuning.
        """
        store = Store.read(Path(folder))
        if study := store.told("study"):
            return cls(store, study)
        raise StudyError(
            f"{folder} contains only results of a comparison or of tuning: give the folder of a "
            "run or a study"
        )

    @cached_property
    def frame(self) -> pd.DataFrame:
        """Table of scores with one row per run and parameter. The main columns come first."""
        table = self._store.frame(self._variants)
        table = table[table["seed"].isin(self.study.get("seeds", table["seed"]))].reset_index(
            drop=True
        )
        for key in self.axes:
            table[key] = [_plain(point.get(key)) for point in table["axes"]]
        return table[[*FIRST, *self.axes, *score_columns(), *LAST]]

    @cached_property
    def _variants(self) -> dict[int, dict[str, Any]]:
        """Properties that all runs of each variant share, in the order of the rows in `frame`."""
        every = self._store.variants()
        labels = {_key(label): label for label in self.study.get("variants", every.values())}
        order = {key: place for place, key in enumerate(labels)}
        known = [(n, about | labels[_key(about)]) for n, about in every.items()
                 if _key(about) in labels]  # fmt: skip
        return dict(sorted(known, key=lambda pair: order[_key(pair[1])]))

    def to_dataframe(self) -> pd.DataFrame:
        """Return `frame`."""
        return self.frame

    @property
    def cases(self) -> int:
        """Number of runs, including failed runs."""
        return int(self.frame["case"].nunique())

    @property
    def missing(self) -> int:
        """Number of runs in the study that have no results, such as the runs of other shards."""
        return len(self.study["variants"]) * len(self.study["seeds"]) - self.cases

    @property
    def failures(self) -> pd.DataFrame:
        """Table of failed runs, with the columns scenario, estimator, setting, seed and error."""
        failed = self.frame[self.frame["error"].notna()].drop_duplicates("case")
        names = ["scenario", "estimator", "setting", "seed", "error"]
        return failed[names].reset_index(drop=True)

    def scores(self, *by: str, scores: Sequence[str] | None = None) -> pd.DataFrame:
        """Return pooled scores with 95 % confidence intervals as a DataFrame (see `pooled`)."""
        return pd.DataFrame(self.pooled(*by, scores=scores))

    def pooled(self, *by: str, scores: Sequence[str] | None = None) -> list[dict[str, Any]]:
        """Return pooled scores with 95 % confidence intervals for each group of rows.

        Parameters
        ----------
        *by : str
            Columns that define the groups (default: scenario, estimator and all swept keys). All
            rows of a group also have the same parameter and the same value of ``changed``.
        scores : sequence of str, optional
            Scores to pool (default: all).

        Returns
        -------
        list of dict
            One dict per group, in the order of the study. Each dict contains the columns in `by`,
            the keys ``parameter``, ``changed``, ``runs`` and ``seeds``, and the same scores as
            summary.json. The excess error of a group with several scenarios is None, because the
            excess error is defined only for a single scenario.

        Raises
        ------
        StudyError
            If a column or score does not exist.
        """
        names = list(by or ("scenario", "estimator", *self.axes))
        chosen = ["failed", *(summary.POOLED if scores is None else scores)]
        asked = [("column", names, self.frame.columns), ("score", chosen, summary.POOLED)]
        for kind, requested, known in asked:
            for name in requested:
                if name not in known:
                    raise StudyError(unknown(kind, name, known))
        told, lines = [*names, "parameter", "changed"], list[dict[str, Any]]()
        keys = self.frame.loc[self.frame["parameter"] != "", [*dict.fromkeys(told)]]
        points = self.frame.groupby(["hash", "setting"], sort=False).ngroup()
        for values, group in keys.groupby(names, sort=False, dropna=False):
            columns = {
                key: summary.columns_of(self.frame.loc[part.index].assign(point=points))
                for key, part in group.groupby(["parameter", "changed"], sort=False)
            }
            shared = self._excess(columns, group.index[0]) if "excess" in chosen else {}
            for key, own in columns.items():
                line = dict(zip(told, map(_value, values + key), strict=True))
                line |= {"runs": len(own["seed"]), "seeds": len({*own["seed"]})}
                line |= summary.pool_columns(own, chosen) | summary.cost(own)
                lines.append(line | shared)
        return lines

    def _excess(self, columns: Mapping[Any, Columns], first: int) -> dict[str, Any]:
        """Return the pooled excess error of a group, which is the same for all parameters."""
        if len({point for own in columns.values() for point in own["point"]}) == 1:
            scenario = self.scenario(self.frame.loc[first])
            by_name = {name: own for (name, _), own in columns.items()}
            asked = {n: v for n, v in by_name.items() if n in scenario.identify} or by_name
            if len({v["seed"].tobytes() for v in asked.values()}) == 1:  # all from the same cases
                return summary.excess(asked, scenario)
        return {"excess": None, "excess_interval": None}

    def scenario(self, row: Mapping[str, Any]) -> Scenario:
        """Return the scenario of a row in `frame`, with the swept values of this row applied."""
        definitions = {s["definition"]["name"]: s["definition"] for s in self.study["scenarios"]}
        base = scenario_from(definitions[row["scenario"]], source=row["scenario"])
        variants = {about["hash"]: about["changes"] for about in self._variants.values()}
        changes = variants[row["hash"]]
        inherit = self.study["streams"] == "common"
        return base.override(changes, inherit=inherit) if changes else base

    def traces(self, scenario_hash: str, setting: str) -> dict[int, Case]:
        """Return the estimates as functions of time, for figures of single runs, keyed by seed.

        Parameters
        ----------
        scenario_hash, setting : str
            Values of the columns ``hash`` and ``setting`` in `frame`.
        """
        seeds, every = {*self.frame["seed"]}, self._store.traces(scenario_hash, setting)
        return {seed: trace for seed, trace in every.items() if seed in seeds}

    def to_csv(self, path: str | Path) -> None:
        """Write the scores of all runs to a CSV file."""
        with new_file(Path(path)) as part:
            self.frame.to_csv(part, index=False)

    def to_parquet(self, path: str | Path) -> None:
        """Write the scores of all runs to a Parquet file; this method requires pyarrow."""
        with new_file(Path(path)) as part:
            self.frame.to_parquet(part, index=False)

    def to_xarray(self) -> xarray.Dataset:
        """Return a Dataset with the dimensions scenario, estimator, point, seed and parameter.

        A point is a combination of swept values. Missing and undefined values are NaN. The swept
        keys are coordinates along the dimension ``point``.
        ``set_index(point=[...]).unstack("point")`` turns the swept keys into separate dimensions.
        """
        axes, table = list(self.axes), self.frame[self.frame["parameter"] != ""]
        points = table.groupby(axes, dropna=False).ngroup() if axes else 0
        table = table.assign(point=points)
        index = ["scenario", "estimator", "point", "seed", "parameter"]
        cube = table.set_index(index)[[*summary.NUMBERS]].astype(float).to_xarray()
        values = table.groupby("point")[axes].first()
        return cube.assign_coords({axis: ("point", values[axis]) for axis in axes})


def _plain(value: Any) -> Any:
    """Convert the value of a swept key to a number or a text that a table can contain."""
    return json.dumps(value) if isinstance(value, list | dict) else value


def _value(value: Any) -> Any:
    """Convert a pandas group label to a Python value, and a missing label to None."""
    return None if pd.isna(value) else getattr(value, "item", lambda: value)()
