"""Where the model is wrong: which scenarios these are, and which rows mean little there.

And tracks: scenarios that ask the same of an estimator, ranked among themselves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flexaxis.experiments.scoring.parameter_names import known_names, nominal_theta, theta_over_time
from flexaxis.experiments.scoring.true_model import known_structure
from flexaxis.sim.scenario import Scenario

Row = Mapping[str, Any]


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
        key
        for row in rows
        for key in [(row["scenario"], row["parameter"], row["estimator"])]
        if row["changed"] and abs(row["bias"] or 0.0) > 0.5 * sizes.get(key[:2], np.inf)
    }


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
