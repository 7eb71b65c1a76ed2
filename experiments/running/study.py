"""What is studied: scenarios, estimators, seeds, and the points of a sweep.

A run is a study without axes: its points are one, at which nothing is changed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flexaxis.experiments.running.errors import StudyError
from flexaxis.sim.scenario import Scenario

Point = dict[str, Any]
"""Values by dotted key, one for each axis."""


@dataclass(frozen=True)
class Study:
    """What is run: every estimator, at every point, on every seed of every scenario.

    Attributes
    ----------
    name : str
    scenarios : tuple of Scenario
        Each with a name of its own.
    estimators : tuple of str
        Texts as for `--estimator`.
    seeds : tuple of int
    axes : tuple of str
        Swept keys; none for a run.
    points : tuple of dict
        Values of these.
    streams : {"common", "own"}
        Whether the points of a scenario share its random numbers, so that what differs between
        them is not noise.

    Raises
    ------
    StudyError
        If two scenarios have one name, or are the same.
    """

    name: str
    scenarios: tuple[Scenario, ...]
    estimators: tuple[str, ...]
    seeds: tuple[int, ...]
    axes: tuple[str, ...] = ()
    points: tuple[Point, ...] = ({},)
    streams: str = "common"

    def __post_init__(self) -> None:
        hashes: dict[str, str] = {}
        for scenario in self.scenarios:
            first = hashes.setdefault(scenario.hash, scenario.name)
            if first != scenario.name:
                raise StudyError(
                    f"{self.name}: the scenarios {first} and {scenario.name} are the same but for "
                    "their names, and would have the same rows: leave one out"
                )
        names = [scenario.name for scenario in self.scenarios]
        if doubles := {name for name in names if names.count(name) > 1}:
            raise StudyError(
                f"{self.name}: two scenarios have the name {min(doubles)!r}, under which their "
                "results would be mixed: give each a `name` of its own"
            )
