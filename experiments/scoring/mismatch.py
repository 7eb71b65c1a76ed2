"""Where the model is wrong: which scenarios these are, and who copes there, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flexaxis.experiments.scoring.ranking import CONTROLS, REFERENCE
from flexaxis.sim.scenario import Scenario

Row = Mapping[str, Any]

UNEQUAL = 1.5  # ratio of deviations up to which one counts as about as quiet


def mismatched(scenarios: Mapping[str, Scenario]) -> list[str]:
    """Return the scenarios that the linear model does not describe, or with changes not meant."""
    return [name for name, s in scenarios.items() if s.nuisance or not s.linear]


def matrix(rows: Sequence[Row], scenarios: Sequence[str]) -> dict[tuple[str, str], Row]:
    """Return the pooled row on the changed parameter, by scenario and estimator.

    Without a fault it is the row with the largest error.
    """
    best: dict[tuple[str, str], Row] = {}
    for row in rows:
        if row["scenario"] in scenarios:
            key = row["scenario"], row["estimator"]
            if key not in best or _weight(row) > _weight(best[key]):
                best[key] = row
    return best


def _weight(row: Row) -> tuple[bool, float]:
    return bool(row["changed"]), abs(row["bias"] or 0.0) + (row["std"] or 0.0)


def mismatch_in_words(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Return who copes best where the model is wrong, and who raises false alarms there.

    Rows are of different runs of the model's choice, so intervals that overlap are no difference.
    """
    faults = [r for r in rows if r["scenario"] in names and r["changed"] and r["lag"] is not None]
    wins: dict[str, int] = {}
    scored = 0
    for name in dict.fromkeys(row["scenario"] for row in faults):
        quiet = _quiet([row for row in faults if row["scenario"] == name])
        if quiet:
            scored += 1
            first = min(quiet, key=lambda row: row["lag"])
            limit = (first["lag_interval"] or [0, first["lag"]])[1]
            for row in {r["estimator"]: r for r in quiet}.values():
                if (row["lag_interval"] or [row["lag"]])[0] <= limit:
                    wins[row["estimator"]] = wins.get(row["estimator"], 0) + 1
    order = sorted(wins.items(), key=lambda item: -item[1])
    text = (
        f"Among the shortest lags (intervals that overlap count for each), with at most "
        f"{UNEQUAL:g} times the deviation of {REFERENCE}: "
        + ", ".join(f"{estimator} in {number} of {scored}" for estimator, number in order)
    )
    alarms: dict[str, list[float]] = {}
    for row in rows:
        if row["scenario"] in names and row.get("detection"):
            rate = row["detection"]["false_alarms_per_1000_s"]
            alarms.setdefault(row["estimator"], []).append(rate)
    if alarms:
        text += ". False alarms in 1000 s: " + ", ".join(
            f"{estimator} {np.mean(counts):.2g}" for estimator, counts in alarms.items()
        )
    return text + "."


def _quiet(rows: list[Row]) -> list[Row]:
    """Return the rows of estimators, not controls, that are about as quiet as the reference."""
    limit = next(
        (UNEQUAL * r["std"] for r in rows if r["estimator"] == REFERENCE and r["std"]), None
    )
    return [
        row
        for row in rows
        if row["estimator"] not in CONTROLS and (limit is None or (row["std"] or 0.0) <= limit)
    ]
