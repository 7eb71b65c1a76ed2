"""What reports are made of, obtained from a folder: pooled rows, single runs, traces.

The only module of reports that knows where results are kept.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.experiments.results.finds import Finds, finds
from flexaxis.experiments.results.results import Results
from flexaxis.experiments.running.folder import read_study
from flexaxis.experiments.running.study import applies, is_option
from flexaxis.experiments.scoring.curves import CURVE_STEP, near_fault
from flexaxis.experiments.scoring.parameter_names import nominal_theta, theta_over_time
from flexaxis.experiments.scoring.summary import Case
from flexaxis.experiments.storage.files import SUMMARY, SWEEP, OutputError, json_table
from flexaxis.experiments.storage.traces import Traces
from flexaxis.sim.scenario import Scenario, stored_scenario

Array = NDArray[np.float64]
Trace = Case
AT_EQUAL_NOISE = "equal_noise"
"""Folder, in that of the sweep, with the runs at the settings nearest to equal noise."""


@dataclass(frozen=True)
class RunInputs:
    """A finished run.

    Attributes
    ----------
    folder : Path
    summary : dict
        As in summary.json.
    """

    folder: Path
    summary: dict[str, Any]

    @classmethod
    def of(cls, folder: Path) -> RunInputs:
        """Return the run in a folder.

        Raises
        ------
        OutputError
            If it holds no finished run.
        """
        if not (folder / SUMMARY).exists():
            raise OutputError(f"{folder} holds no finished run: {SUMMARY} is missing")
        return cls(folder, json_table(folder / SUMMARY, OutputError))

    @cached_property
    def scenarios(self) -> dict[str, Scenario]:
        """The scenarios of the run, and those that were only swept."""
        study = read_study(self.folder)
        swept = (study.get("tradeoff") or {}).get("scenarios", ())
        entries = [e["definition"] for e in self.summary["scenarios"].values()] + list(swept)
        return {e["name"]: stored_scenario(e, source=str(self.folder)) for e in reversed(entries)}

    @cached_property
    def runs(self) -> pd.DataFrame:
        """A row a scenario, estimator, seed and parameter, of runs that did not fail."""
        rows = Results.load(self.folder).ran().to_dataframe()
        return rows[rows["error"].isna()]

    def traces(self, scenario: str, estimator: str) -> Mapping[int, Trace]:
        """Return what the runs of an estimator are drawn from, by seed."""
        return self._traces[""].find(self.scenarios[scenario].hash, estimator)

    def at_equal_noise(self, scenario: str, setting: str) -> Mapping[int, Trace]:
        """Return the same of a swept setting; nothing where it was not kept."""
        return self._traces[AT_EQUAL_NOISE].find(self.scenarios[scenario].hash, setting)

    @cached_property
    def _traces(self) -> dict[str, Traces]:
        codes, seeds = read_study(self.folder).get("code", {}), self.summary["seeds"]
        swept = self.folder / SWEEP / AT_EQUAL_NOISE
        kept = swept if swept.is_dir() else None
        return {"": Traces(self.folder, codes, seeds), AT_EQUAL_NOISE: Traces(kept, codes, seeds)}


def estimates(
    traces: Mapping[int, Trace], scenario: Scenario, parameter: str
) -> tuple[Array, Array]:
    """Return times (M,) [s], and the estimates (n, M) over nominal of n runs.

    Around the first fault every sample is there, else one in `CURVE_STEP`.
    """
    whole, near = scenario.times[::CURVE_STEP], scenario.times[near_fault(scenario)]
    ends = (near[0], near[-1]) if len(near) else (np.inf, -np.inf)
    before, behind = whole < ends[0], whole > ends[1]
    values = []
    for trace in traces.values():
        i = trace.names.index(parameter)
        curve, detail = trace.curve[:, i], trace.detail.near
        parts = [curve[before], detail[:, i] if len(near) else [], curve[behind]]
        values.append(np.concatenate(parts))
    time = np.concatenate([whole[before], near, whole[behind]])
    return time, np.array(values, float).reshape(-1, len(time))


def truth(scenario: Scenario, parameter: str) -> Array:
    """Return the true values (N,) of a parameter over nominal."""
    values = theta_over_time(scenario, [parameter])[:, 0]
    return np.asarray(values / nominal_theta(scenario, [parameter])[0], float)


FEW = 9  # settings of estimators that a figure tells apart: as many as there are colours
BINS, MANY = 8, 24  # of an axis with more values than can be drawn each


@dataclass(frozen=True)
class StudyInputs:
    """A study with axes.

    Attributes
    ----------
    results : Results
    """

    results: Results

    @property
    def study(self) -> Mapping[str, Any]:
        """The question, as it was asked."""
        return self.results.study

    @cached_property
    def values(self) -> dict[str, list[Any]]:
        """The values of each axis."""
        return self.results.values()

    @cached_property
    def numeric(self) -> list[str]:
        """Axes of several numbers, those of a fault first."""
        found = [
            axis
            for axis, seen in self.values.items()
            if len(seen) > 1 and all(isinstance(v, int | float) for v in seen)
        ]
        return sorted(found, key=lambda axis: not axis.startswith("fault"))

    def options(self, axes: Sequence[str] = ()) -> list[str]:
        """Return the swept options that are told apart beside some axes: all, or too many, none."""
        names = self.study["estimators"]
        options = [a for a in self.results.axes if is_option(a, tuple(names)) and a not in axes]
        count = sum(
            int(np.prod([max(1, len(self.values[key])) for key in options if applies(key, name)]))
            for name in names
        )
        return options if count <= FEW else []

    def averaged(self, axes: Sequence[str]) -> list[str]:
        """Return the axes that rows over some axes are averaged over."""
        apart = [*axes, *self.options(axes)]
        return [a for a in self.results.axes if a not in apart and len(self.values[a]) > 1]

    def pooled(self, axes: Sequence[str], *, scenario: bool = False) -> pd.DataFrame:
        """Return pooled rows over some axes, with the estimator and its options as `estimator`."""
        options = self.options(axes)
        by = ["base"] * scenario + ["method", *options, *axes]
        rows = pd.DataFrame(
            self.results.pooled(
                by,
                bins={
                    a: self._edges(a)
                    for a in by
                    if len(self.values.get(a, ())) > MANY and a in self.numeric
                },
            )
        )
        if rows.empty:
            return rows
        names = [_named(row, options) for row in rows.to_dict("records")]
        rows = rows.assign(estimator=names).rename(columns={"base": "scenario"})
        known = rows[list(axes)].notna().all(axis=1)
        return rows[known]

    def _edges(self, axis: str) -> list[float]:
        shares = np.linspace(0, 1, BINS + 1)
        edges: list[float] = np.unique(np.quantile(self.values[axis], shares)).tolist()
        return edges

    def finds(self) -> list[Finds]:
        """Return how often faults are found over their size, where there are twins."""
        return finds(self.results)

    def detection(self) -> pd.DataFrame:
        """Return a row a setting that reports findings: delay [s], missed [%], false alarms."""
        groups, rows = self.results.grouped(["method", "estimator"], cases=True), []
        for i, key in enumerate(groups.keys):
            columns = groups.columns(i)
            if np.isnan(columns["detection.alarms"]).all():
                continue
            sums = {
                n: np.nansum(columns[n])
                for n in (
                    "detection.missed",
                    "detection.faults",
                    "detection.false_alarms",
                    "seconds",
                )
            }
            delays = columns["detection.delay"]
            rows.append(
                {
                    **key,
                    "delay": np.nanmean(delays) if np.isfinite(delays).any() else np.nan,
                    "missed": 100 * sums["detection.missed"] / max(1.0, sums["detection.faults"]),
                    "false": 3600 * sums["detection.false_alarms"] / sums["seconds"],
                }
            )
        return pd.DataFrame(rows)

    def isolation(self) -> pd.DataFrame:
        """Return how often each fault was taken for what, in % of the faults."""
        groups = self.results.grouped(["method", "isolation"], cases=True)
        counts: Counter[tuple[str, str, str]] = Counter()
        for key, rows in zip(groups.keys, groups.rows, strict=True):
            for entry in json.loads(key["isolation"] or "[]"):
                names = entry["named"]
                word = (
                    "missed" if names is None else "several" if len(names) > 1 else "".join(names)
                )
                counts[key["method"], entry["fault"], word or "unexplained"] += len(rows)
        if not counts:
            return pd.DataFrame()
        index = pd.MultiIndex.from_tuples(counts, names=["estimator", "changed", "named"])
        table = pd.Series(list(counts.values()), index).unstack("named", fill_value=0)
        return 100 * table.div(table.sum(axis=1), axis=0)


def _named(row: Mapping[str, Any], options: Sequence[str]) -> str:
    """Return the estimator of a row with the options that are told apart.

    Examples
    --------
    >>> _named({"method": "ekf", "ekf.walk": 0.5, "imm.walk": None}, ["ekf.walk", "imm.walk"])
    'ekf[walk=0.5]'
    """
    texts = [
        f"{key.rpartition('.')[2]}={row[key]:.3g}"
        if isinstance(row[key], float)
        else f"{key.rpartition('.')[2]}={row[key]}"
        for key in options
        if not pd.isna(row[key])
    ]
    name, _, rest = str(row["method"]).partition("[")
    inside = ",".join(filter(None, [rest.removesuffix("]"), *texts]))
    return f"{name}[{inside}]" if inside else name
