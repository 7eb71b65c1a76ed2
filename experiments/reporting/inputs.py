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

from flexaxis.experiments.results.results import Results
from flexaxis.experiments.running.folder import read_study
from flexaxis.experiments.running.study import is_option
from flexaxis.experiments.scoring.curves import CURVE_STEP, near_fault
from flexaxis.experiments.scoring.parameter_names import nominal_theta, theta_over_time
from flexaxis.experiments.scoring.summary import Case
from flexaxis.experiments.storage.files import SUMMARY, SWEEP, OutputError, json_table
from flexaxis.experiments.storage.traces import Traces
from flexaxis.sim.scenario import Scenario, scenario_from

AT_EQUAL_NOISE = "equal_noise"
"""Folder, in that of the sweep, with the runs at the settings nearest to equal noise."""


@dataclass(frozen=True)
class RunInputs:
    """A finished run: its folder, and what stands in its summary.json."""

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
            raise OutputError(
                f"{folder} holds no complete result of a run: {SUMMARY} is missing. Make one with "
                "`flexaxis run … -o FOLDER`"
            )
        return cls(folder, json_table(folder / SUMMARY, OutputError))

    @cached_property
    def scenarios(self) -> dict[str, Scenario]:
        """The scenarios of the run, then those that were only swept."""
        known = {n: entry["definition"] for n, entry in self.summary["scenarios"].items()}
        swept = (self.summary.get("tradeoff") or {}).get("definitions", {})
        return {n: scenario_from(e, source=n) for n, e in ({**known, **swept}).items()}

    @cached_property
    def runs(self) -> pd.DataFrame:
        """A row a scenario, estimator, seed and parameter, of runs that did not fail."""
        rows = Results.load(self.folder).ran().to_dataframe()
        rows["over_bound"] = rows["lag"] / rows["lag_bound"]
        return rows[rows["error"].isna()]

    def traces(self, scenario: str, estimator: str, part: str = "") -> Mapping[int, Case]:
        """Return what the runs of an estimator are drawn from, by seed; `part` as a folder."""
        codes = read_study(self.folder).get("code", {})
        folder = self.folder / part
        if not folder.is_dir():
            return {}
        traces = Traces(folder, codes, self.summary["seeds"])
        return traces.find(self.scenarios[scenario].hash, estimator)

    def at_equal_noise(self, scenario: str, setting: str) -> Mapping[int, Case]:
        """Return the same of the setting nearest to equal noise; nothing where it was not kept."""
        return self.traces(scenario, setting, f"{SWEEP}/{AT_EQUAL_NOISE}")


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
    several = [a for a, seen in results.values().items()
               if len(seen) > 1 and not any(isinstance(v, str | None) for v in seen)]  # fmt: skip
    return sorted(several, key=lambda axis: not axis.startswith("fault"))


def pooled(results: Results, axes: Sequence[str], *by: str) -> pd.DataFrame:
    """Return pooled rows over some axes; an estimator is named with its swept options."""
    names = tuple(results.study["estimators"])
    options = [a for a in results.axes if is_option(a, names) and a not in axes]
    rows = pd.DataFrame(results.pooled([*by, "method", *options, *axes])).rename(
        columns={"base": "scenario", "method": "estimator"}
    )
    for option in options:
        text = rows[option].map(lambda v, o=option: f"[{o.rpartition('.')[2]}={v}]")
        rows["estimator"] += text.where(rows[option].notna(), "")
    return rows.dropna(subset=list(axes)) if len(rows) else rows
