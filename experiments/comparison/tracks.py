"""Tracks: scenarios that ask the same of an estimator, ranked among themselves."""

from __future__ import annotations

from collections.abc import Mapping

from flexaxis.experiments.scoring.true_model import known_structure
from flexaxis.sim.scenario import Scenario

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
    >>> for name in ("fm_step-v1", "coulomb_fm_step-v1", "power_fm_step-v1", "warming_fm_step-v1"):
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
