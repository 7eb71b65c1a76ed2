"""What a report says first: who is fastest at equal variance, who leads, and what mismatch does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexaxis.experiments.tradeoff import REFERENCE
from flexaxis.sim.scenario import Scenario

Row = Mapping[str, Any]

UNEQUAL = 1.5  # ratio of deviations that is worth a word
CONTROLS = ("frozen", "oracle-reset")  # they know more than an estimator may, or nothing


@dataclass(frozen=True)
class Standing:
    """Where an estimator stands.

    Attributes
    ----------
    estimator : str
    score : float
        Mean over the scenarios in which a score is defined for all estimators.
    half_width : float or None
        Of its 95 % interval over seeds.
    scenarios : int
        How many these are.
    diverged, never_settled : int
        Runs, in all scenarios.
    false_alarms : float or None
        A run, in all scenarios; None for an estimator that gives no alarms.
    """

    estimator: str
    score: float
    half_width: float | None
    scenarios: int
    diverged: int
    never_settled: int
    false_alarms: float | None


@dataclass(frozen=True)
class Matrix:
    """Scenarios down, estimators across; a cell is the pooled row on the parameter that changed."""

    scenarios: tuple[str, ...]
    estimators: tuple[str, ...]
    cells: Mapping[tuple[str, str], Row]


def answers(matched: Sequence[Row], words: Mapping[str, str]) -> list[str]:
    """Return for each scenario who follows the fault fastest at equal variance.

    Parameters
    ----------
    matched : sequence of mapping
        As from `flexaxis.experiments.tradeoff.matched`.
    words : mapping of str to str
        What each fault is, by scenario.
    """
    found = []
    for scenario in dict.fromkeys(row["scenario"] for row in matched):
        mine = [row for row in matched if row["scenario"] == scenario and row["lag"] is not None]
        order = [row for row in mine if row["estimator"] not in CONTROLS]
        order.sort(key=lambda row: row["lag"])
        if len(order) > 1:
            found.append(_answer(order, f"{scenario} ({words[scenario]})"))
    return found


def _answer(order: list[Row], fault: str) -> str:
    """Return a sentence on the estimators of one scenario, the fastest first."""
    first, second = order[:2]
    text = f"{fault}: {first['estimator']} follows {first['parameter']} fastest, {_lag(first)}"
    if _apart(first, second):
        text += f"; next comes {second['estimator']}, {_lag(second)}"
    else:
        text += f"; these seeds cannot tell it from {second['estimator']}, {_lag(second)}"
    for row in order[2:]:
        if row["estimator"] == REFERENCE:
            text += f"; the paper's method, {REFERENCE}, {_lag(row)}"
    return text + "."


def _lag(row: Row) -> str:
    text = f"lag {row['lag']:.2g} s"
    if row["over_bound"]:
        text += f" ({row['over_bound']:.2g} times the bound)"
    own = row["own_ratio"]
    if own and not 1 / UNEQUAL < own < UNEQUAL:  # equal in the mean over θ, not in this one
        text += f", with {own:.2g} times the deviation in {row['parameter']} itself"
    return text


def _apart(first: Row, second: Row) -> bool:
    """Whether the intervals of two lags do not overlap."""
    one, other = first["lag_interval"], second["lag_interval"]
    return bool(one and other and one[1] < other[0])


def standings(rows: Sequence[Row]) -> list[Standing]:
    """Return the estimators by their mean score, the best first."""
    estimators = list(dict.fromkeys(row["estimator"] for row in rows))
    scored = {(r["scenario"], r["estimator"]): r for r in rows if r.get("score") is not None}
    common = [
        scenario
        for scenario in dict.fromkeys(scenario for scenario, _ in scored)
        if all((scenario, estimator) in scored for estimator in estimators)
    ]
    if not common:
        return []
    found = [
        _standing(
            estimator,
            [scored[scenario, estimator] for scenario in common],
            [row for row in rows if row["estimator"] == estimator],
        )
        for estimator in estimators
    ]
    return sorted(found, key=lambda standing: -standing.score)


def _standing(estimator: str, scored: list[Row], rows: list[Row]) -> Standing:
    widths = [np.ptp(row["score_interval"]) / 2 for row in scored if row["score_interval"]]
    # The seeds of different scenarios are independent runs: their intervals add in quadrature.
    complete = len(widths) == len(scored)
    one_each = {row["scenario"]: row for row in rows}.values()  # the same on all its parameters
    alarms = [row["detection"]["false_alarms"] for row in one_each if row.get("detection")]
    return Standing(
        estimator=estimator,
        score=float(np.mean([row["score"] for row in scored])),
        half_width=float(np.sqrt(np.sum(np.square(widths))) / len(scored)) if complete else None,
        scenarios=len(scored),
        diverged=_worst_by_scenario(rows, "diverged"),
        never_settled=sum(row["never_settled"] for row in rows if row["changed"]),
        false_alarms=float(np.mean(alarms)) if alarms else None,
    )


def _worst_by_scenario(rows: Sequence[Row], key: str) -> int:
    """Return the sum over scenarios of the largest count among the parameters."""
    counts: dict[str, int] = {}
    for row in rows:
        counts[row["scenario"]] = max(counts.get(row["scenario"], 0), row[key])
    return sum(counts.values())


def matrix(rows: Sequence[Row], scenarios: Sequence[str]) -> Matrix:
    """Return the pooled rows on the changed parameters, for some scenarios.

    Without a fault it is the row with the largest error.
    """
    best: dict[tuple[str, str], Row] = {}
    for row in rows:
        if row["scenario"] in scenarios:
            key = row["scenario"], row["estimator"]
            if key not in best or _weight(row) > _weight(best[key]):
                best[key] = row
    estimators = tuple(dict.fromkeys(row["estimator"] for row in rows))
    return Matrix(tuple(scenarios), estimators, best)


def _weight(row: Row) -> tuple[bool, float]:
    return bool(row["changed"]), abs(row["bias"] or 0.0) + (row["std"] or 0.0)


def mismatched(scenarios: Mapping[str, Scenario]) -> list[str]:
    """Return the scenarios that the linear model does not describe, or with changes not meant."""
    return [name for name, s in scenarios.items() if s.nuisance or not s.linear]


def mismatch_in_words(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Return who copes best where the model is wrong, and who raises false alarms there."""
    faults = [r for r in rows if r["scenario"] in names and r["changed"] and r["lag"] is not None]
    wins: dict[str, int] = {}
    for name in dict.fromkeys(row["scenario"] for row in faults):
        quiet = _quiet([row for row in faults if row["scenario"] == name])
        if quiet:
            first = min(quiet, key=lambda row: row["lag"])["estimator"]
            wins[first] = wins.get(first, 0) + 1
    text = (
        f"Shortest lag, with at most {UNEQUAL:g} times the deviation of {REFERENCE}: "
        + ", ".join(
            f"{estimator} in {count} of {sum(wins.values())}"
            for estimator, count in sorted(wins.items(), key=lambda item: -item[1])
        )
    )
    alarms: dict[str, list[float]] = {}
    for row in rows:
        if row["scenario"] in names and row.get("detection"):
            alarms.setdefault(row["estimator"], []).append(row["detection"]["false_alarms"])
    if alarms:
        text += ". False alarms a run: " + ", ".join(
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
