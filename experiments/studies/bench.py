"""Rows as nested tables, for the searches and the gate as they are; goes with them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from flexaxis.experiments.running.run import Runner, check_failures
from flexaxis.sim.scenario import Scenario

Row = dict[str, Any]
Runs = list[list[Row]]
"""Rows of an estimator on a scenario: a list a seed, in their order, with a row a parameter."""


def nested(frame: pd.DataFrame) -> list[Row]:
    """Return rows as dicts; columns with a dot in their name are tables, NaN is None."""
    rows = []
    for line in frame.to_dict("records"):
        row: Row = {}
        for name, value in line.items():
            table, _, part = str(name).partition(".")
            known = None if not isinstance(value, bool | str) and pd.isna(value) else value
            if part:
                row.setdefault(table, {})[part] = known
            else:
                row[table] = known
        for name, value in row.items():
            if isinstance(value, dict) and name != "cost" and set(value.values()) == {None}:
                row[name] = None
        row["isolation"] = row["isolation"] and json.loads(row["isolation"])
        rows.append(row)
    return rows


@dataclass(frozen=True)
class Bench:
    """Where cases are run that are asked for bit by bit, each once."""

    runner: Runner
    traced: bool = False
    repeat: int = 0

    def runs(
        self, scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int]
    ) -> dict[tuple[str, str], Runs]:
        """Return the rows of some cases, by hash of the scenario and text of the estimator.

        Raises
        ------
        EstimatorError, StudyError
            If one of them failed.
        """
        frame = self.frame(scenarios, estimators, seeds)
        check_failures(frame)
        return self._by_case(frame, seeds)

    def with_failed(
        self, scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int]
    ) -> dict[tuple[str, str], Runs]:
        """Return the same with the cases that failed: their rows are of lost runs."""
        return self._by_case(self.frame(scenarios, estimators, seeds), seeds)

    def frame(
        self, scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int]
    ) -> pd.DataFrame:
        """Return the rows as a table."""
        how = {"traces": self.traced, "repeat": self.repeat}
        return self.runner.rows(scenarios, estimators, seeds, **how)  # type: ignore[arg-type]

    @staticmethod
    def _by_case(frame: pd.DataFrame, seeds: Sequence[int]) -> dict[tuple[str, str], Runs]:
        found: dict[tuple[str, str], dict[int, list[Row]]] = {}
        for row in nested(frame):
            runs = found.setdefault((row["hash"], row["estimator"]), {seed: [] for seed in seeds})
            runs[row["seed"]].append(row)
        return {key: list(runs.values()) for key, runs in found.items()}
