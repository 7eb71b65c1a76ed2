"""What reports are made of, obtained from a folder: pooled rows, single runs, traces.

The only module of reports that knows where results are kept.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from flexaxis.experiments.running.results import Results
from flexaxis.experiments.running.study import is_option
from flexaxis.experiments.scoring.curves import CURVE_STEP, near_fault
from flexaxis.experiments.scoring.parameter_names import nominal_theta, theta_over_time
from flexaxis.experiments.scoring.summary import Case
from flexaxis.sim.scenario import Scenario, scenario_from


@dataclass(frozen=True)
class RunInputs:
    """A finished run: its results, and what stands in its summary.json."""

    results: Results
    summary: dict[str, Any]

    @classmethod
    def of(cls, folder: Path) -> RunInputs:
        """Return the run in a folder.

        Raises
        ------
        StudyError, OutputError
            If it holds no finished run.
        """
        results = Results.load(folder)
        return cls(results, results.summary)

    @cached_property
    def scenarios(self) -> dict[str, Scenario]:
        """The scenarios of the run, then those that were only swept."""
        known = {n: entry["definition"] for n, entry in self.summary["scenarios"].items()}
        known |= (self.summary.get("tradeoff") or {}).get("definitions", {})
        return {name: scenario_from(each, source=name) for name, each in known.items()}

    @cached_property
    def runs(self) -> pd.DataFrame:
        """A row a scenario, estimator, seed and parameter, of runs that did not fail."""
        rows = self.results.frame
        rows = rows[rows["error"].isna()]
        return rows.assign(over_bound=rows["lag"] / rows["lag_bound"])

    def traces(self, scenario: str, setting: str) -> Mapping[int, Case]:
        """Return what the runs of an estimator are drawn from, by seed; empty if not kept."""
        return self.results.traces(self.scenarios[scenario].hash, setting)


def estimates(traces: Mapping[int, Case], scenario: Scenario, parameter: str) -> pd.DataFrame:
    """Return estimates over nominal: a line a time [s], a column a seed.

    Around the first fault every sample is there, else one in `CURVE_STEP`.
    """
    every = scenario.times
    times = np.r_[every[::CURVE_STEP], every[near_fault(scenario)]]
    runs = {seed: np.r_[trace.curve, trace.detail.near][:, trace.names.index(parameter)]
            for seed, trace in traces.items()}  # fmt: skip
    table = pd.DataFrame(runs, index=times, dtype=float)
    return table[~table.index.duplicated()].sort_index()


def truth(scenario: Scenario, parameter: str) -> pd.Series:
    """Return the true values of a parameter over nominal, over time [s]."""
    values = theta_over_time(scenario, [parameter]) / nominal_theta(scenario, [parameter])
    return pd.Series(values[:, 0], scenario.times)


def around(scenario: Scenario) -> dict[str, Any]:
    """Return what a figure over the time of a scenario marks, as options of `curves`."""
    events = {event.parameter: event.index * scenario.period for event in scenario.events()[::-1]}
    edges = np.flatnonzero(np.diff(np.r_[1, scenario.excited(), 1])) * scenario.period
    still = [(*pair, "no excitation") for pair in edges.reshape(-1, 2)]
    return {
        "marks": [(at, f"{name} changes") for name, at in events.items()],
        "spans": [(0.0, scenario.burn_in, "burn-in"), *still],
    }


def numeric_axes(results: Results) -> list[str]:
    """Return the axes of a study with several numbers, those of a fault first."""
    axes = results.frame[list(results.axes)]
    several = axes.loc[:, axes.nunique() > 1]
    numbers = several.apply(pd.to_numeric, errors="coerce").notna() | several.isna()
    return sorted(several.loc[:, numbers.all()], key=lambda axis: not axis.startswith("fault"))


def pooled(results: Results, axes: Sequence[str], *by: str) -> pd.DataFrame:
    """Return pooled rows over some axes; an estimator is named with its swept options."""
    names = tuple(results.study["estimators"])
    options = [a for a in results.axes if is_option(a, names) and a not in axes]
    rows = results.scores(*by, "estimator", *options, *axes)
    for option in options:
        text = f"[{option.rpartition('.')[2]}=" + rows[option].astype(str) + "]"
        rows["estimator"] += text.where(rows[option].notna(), "")
    return rows.dropna(subset=list(axes)) if len(rows) else rows
