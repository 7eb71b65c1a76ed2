"""Where the model is wrong: which scenarios these are, and who copes there, in words.

And tracks: scenarios that ask the same of an estimator, ranked among themselves.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from flexaxis.experiments.comparison.ranking import (
    CONTROLS,
    REFERENCE,
    by_fault,
    leaders,
    too_few,
)
from flexaxis.experiments.scoring.intervals import rate_interval
from flexaxis.experiments.scoring.parameter_names import known_names, nominal_theta, theta_over_time
from flexaxis.experiments.scoring.true_model import known_structure
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


def misled(rows: Sequence[Row], scenarios: Mapping[str, Scenario]) -> set[tuple[str, str, str]]:
    """Return (scenario, parameter, estimator) whose bias before a fault is over half its size.

    Such an estimate may pass the new value only because it was that wrong before: its lag says
    nothing of how soon it follows.

    Parameters
    ----------
    rows : sequence of mapping
        Pooled rows, `bias` in per cent of nominal.
    scenarios : mapping of str to Scenario
    """
    sizes: dict[tuple[str, str], float] = {}
    for name, scenario in scenarios.items():
        names = tuple(dict.fromkeys(r["parameter"] for r in rows if r["scenario"] == name))
        known = known_names(scenario, names)
        if known:
            change = np.ptp(theta_over_time(scenario, known), axis=0)
            percent = 100 * change / np.abs(nominal_theta(scenario, known))
            sizes |= {(name, each): size for each, size in zip(known, percent, strict=True)}
    return {
        _key(row)
        for row in rows
        if row["changed"]
        and abs(row["bias"] or 0.0) > 0.5 * sizes.get((row["scenario"], row["parameter"]), np.inf)
    }


def mismatch_in_words(
    rows: Sequence[Row],
    as_set: Sequence[Row],
    names: Sequence[str],
    wrong: Collection[tuple[str, str, str]] = (),
) -> str:
    """Return who copes best where the model is wrong, and who raises false alarms there.

    Parameters
    ----------
    rows : sequence of mapping
        Pooled rows of all scenarios.
    as_set : sequence of mapping
        As from `flexaxis.experiments.studies.as_set.as_set`: the values that are paired.
    names : sequence of str
        The scenarios that are meant.
    wrong : collection of (str, str, str)
        As from `misled`: these do not compete.
    """
    mine = [row for row in as_set if row["scenario"] in names]
    faults, wins = by_fault(mine), Counter[str]()
    for rows_of in faults.values():
        quiet = [row for row in _quiet(rows_of) if _key(row) not in wrong]
        wins.update(leaders({row["estimator"]: row["values"]["lag"] for row in quiet}))
    told = ", ".join(f"{name} in {number} of {len(faults)}" for name, number in wins.most_common())
    told = told or too_few(mine) or "nobody"
    text = (
        f"Shortest lag, or not to be told from it on these seeds, with at most {UNEQUAL:g} times "
        f"the deviation of {REFERENCE} in the parameter that changes: {told}"
    )
    passed = dict.fromkeys(row["estimator"] for row in mine if _key(row) in wrong)
    if passed:
        text += (
            ". Not ranked where the bias before a fault is more than half of its size, for the "
            f"estimate was wrong already: {', '.join(passed)}"
        )
    return f"{text}{_false_alarms([row for row in rows if row['scenario'] in names])}."


def _false_alarms(rows: Sequence[Row]) -> str:
    """Return how many false alarms each has raised, in how long, and what that allows."""
    cases: dict[str, dict[str, Row]] = {}
    for row in rows:
        if (row.get("detection") or {}).get("calm"):
            cases.setdefault(row["estimator"], {})[row["scenario"]] = row
    said = []
    for estimator, each in cases.items():
        counts = [row["detection"]["false_alarms"] * row["runs"] for row in each.values()]
        hours = sum(row["detection"]["calm"] for row in each.values()) / 3600
        low, high = rate_interval(counts, hours, range(len(counts)))
        within = f"{low:.2g} to {high:.2g}" if low else f"at most {high:.2g}"
        said.append(f"{estimator} {sum(counts):.0f} in {hours:.2g} h ({within} an hour)")
    return f". False alarms: {', '.join(said)}" if said else ""


def _key(row: Row) -> tuple[str, str, str]:
    return row["scenario"], row["parameter"], row["estimator"]


def _quiet(rows: list[Row]) -> list[Row]:
    """Return the rows of estimators, not controls, that are about as quiet as the reference."""
    limit = next(
        (UNEQUAL * r["std"] for r in rows if r["estimator"] == REFERENCE and r["std"]), np.inf
    )
    return [r for r in rows if r["estimator"] not in CONTROLS and (r["std"] or 0.0) <= limit]


NOMINAL, KNOWN = "nominal", "known structure"
UNKNOWN, NUISANCE = "unknown structure", "nuisance"

TRACKS: Mapping[str, str] = {
    NOMINAL: "The linear model with the values that are told describes the axis; what is asked is "
    "to follow faults fast and quietly.",
    KNOWN: "Friction, backlash, cogging or wrong data-sheet values besides; a model with laws "
    "can describe the axis from what is told.",
    UNKNOWN: "A law, a sensor or a loop that no model knows, or that the data sheet hides; what is "
    "asked is to stay near the truth all the same.",
    NUISANCE: "Something changes that is no fault, such as warming up or a load; it is to be "
    "followed without an alarm.",
}
"""A sentence each, in the order in which they are read."""


def track_of(scenario: Scenario) -> str:
    """Return the track of a scenario; a change that is no fault decides before all else.

    Examples
    --------
    >>> from flexaxis.experiments.catalogue.find import find_scenario
    >>> for name in ("fm_step", "coulomb_fm_step", "load_friction_fm_step", "warming_fm_step"):
    ...     print(track_of(find_scenario(name)))
    nominal
    known structure
    unknown structure
    nuisance
    """
    if scenario.nuisance:
        return NUISANCE
    if scenario.linear:
        return NOMINAL
    return KNOWN if known_structure(scenario) else UNKNOWN
