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


def estimates(traces: Mapping[int, Case], scenario: Scenario, parameter: str) -> Any:
    """Return times (M,) [s], and the estimates (n, M) over nominal of n runs.

    Around the first fault every sample is there, else one in `CURVE_STEP`.
    """
    near = near_fault(scenario)
    kept = np.r_[np.arange(0, scenario.samples, CURVE_STEP), np.arange(scenario.samples)[near]]
    kept, first = np.unique(kept, return_index=True)
    values = []
    for trace in traces.values():
        i = trace.names.index(parameter)
        values.append(np.r_[trace.curve[:, i], trace.detail.near[:, i]][first])
    return scenario.times[kept], np.array(values, float)


def truth(scenario: Scenario, parameter: str) -> Any:
    """Return the true values (N,) of a parameter over nominal."""
    values = theta_over_time(scenario, [parameter])[:, 0]
    return values / nominal_theta(scenario, [parameter])[0]


def numeric_axes(results: Results) -> list[str]:
    """Return the axes of a study with several numbers, those of a fault first."""
    axes = results.frame[list(results.axes)]
    several = [a for a in axes if axes[a].nunique() > 1 and pd.to_numeric(
        axes[a], errors="coerce").notna().sum() == axes[a].notna().sum()]  # fmt: skip
    return sorted(several, key=lambda axis: not axis.startswith("fault"))


def pooled(results: Results, axes: Sequence[str], *by: str) -> pd.DataFrame:
    """Return pooled rows over some axes; an estimator is named with its swept options."""
    names = tuple(results.study["estimators"])
    options = [a for a in results.axes if is_option(a, names) and a not in axes]
    rows = results.scores(*by, "estimator", *options, *axes)
    for option in options:
        text = rows[option].map(lambda v, o=option: f"[{o.rpartition('.')[2]}={v}]")
        rows["estimator"] += text.where(rows[option].notna(), "")
    return rows.dropna(subset=list(axes)) if len(rows) else rows
