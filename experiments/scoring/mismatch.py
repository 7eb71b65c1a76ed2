"""Where the model is wrong: which scenarios these are, and who copes there, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flexaxis.experiments.scoring.ranking import CONTROLS, REFERENCE, leaders
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


def mismatch_in_words(rows: Sequence[Row], as_set: Sequence[Row], names: Sequence[str]) -> str:
    """Return who copes best where the model is wrong, and who raises false alarms there.

    Parameters
    ----------
    rows : sequence of mapping
        Pooled rows of all scenarios.
    as_set : sequence of mapping
        As from `flexaxis.experiments.studies.as_set.as_set`: the values that are paired.
    names : sequence of str
        The scenarios that are meant.
    """
    mine = [row for row in as_set if row["scenario"] in names]
    faults = dict.fromkeys((row["scenario"], row["parameter"]) for row in mine)
    wins: dict[str, int] = {}
    for fault in faults:
        quiet = _quiet([row for row in mine if (row["scenario"], row["parameter"]) == fault])
        for name in leaders({row["estimator"]: row["values"]["lag"] for row in quiet}):
            wins[name] = wins.get(name, 0) + 1
    order = sorted(wins.items(), key=lambda item: -item[1])
    text = (
        f"Shortest lag, or not to be told from it on these seeds, with at most {UNEQUAL:g} times "
        f"the deviation of {REFERENCE} in the parameter that changes: "
        + ", ".join(f"{estimator} in {number} of {len(faults)}" for estimator, number in order)
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
        (UNEQUAL * r["std"] for r in rows if r["estimator"] == REFERENCE and r["std"]), np.inf
    )
    return [r for r in rows if r["estimator"] not in CONTROLS and (r["std"] or 0.0) <= limit]
