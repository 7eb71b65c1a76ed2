"""What is studied: scenarios, estimators, seeds, the points of a sweep; and units of work of it.

A run is a study without axes: its points are one, at which nothing is changed.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from flexaxis.experiments.storage.files import StudyError
from flexaxis.sim.errors import ScenarioError
from flexaxis.sim.scenario import Scenario

Point = dict[str, Any]
"""Values by dotted key, one for each axis."""
ALL = "estimator"  # before the name of an option: that of every estimator
SIZE = re.compile(r"fault\[(\d+)\]\.factor")  # the size of a fault


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


def applies(key: str, estimator: str) -> bool:
    """Whether an axis is an option of this estimator: "estimator.X" of all, "NAME.X" of one.

    Examples
    --------
    >>> applies("estimator.forgetting", "rpem-forgetting")
    True
    >>> applies("ekf.walk", "rpem-forgetting")
    False
    """
    return key.rpartition(".")[0] in {ALL, estimator.partition("[")[0].strip()}


def is_option(key: str, estimators: Sequence[str]) -> bool:
    """Whether an axis is an option of estimators, and not a key of the scenario."""
    return key.rpartition(".")[0] == ALL or any(applies(key, text) for text in estimators)


def in_words(axes: Mapping[str, Any]) -> str:
    """Return a point in words: "fault[0].factor = 1.5, start = 1.2"."""
    return ", ".join(f"{key} = {json.dumps(value)}" for key, value in axes.items())


@dataclass(frozen=True)
class EstimatorSetting:
    """An estimator at one setting of its swept options.

    Attributes
    ----------
    method : str
        As it stands in the study.
    text : str
        With the options set.
    axes : dict
        The options, by their swept keys.
    code : str, optional
        Digest of the code of a user, as it was when this was planned.
    """

    method: str
    text: str
    axes: Mapping[str, Any]
    code: str | None = None


@dataclass(frozen=True)
class Variant:
    """A scenario at one setting of its swept keys, and the estimators that get its records."""

    base: Scenario
    axes: Mapping[str, Any]
    hash: str
    duration: float
    entries: tuple[EstimatorSetting, ...]
    common: bool = True

    def scenario(self) -> Scenario:
        """Return the scenario: made when it is needed, for a plan may hold many."""
        return varied(self.base, self.axes, common=self.common)


def varied(base: Scenario, axes: Mapping[str, Any], *, common: bool = True) -> Scenario:
    """Return a point of a sweep: by default with the random numbers of the scenario it varies."""
    return base.override(axes, inherit=common) if axes else base


def find_point(bases: Sequence[Scenario], axes: Mapping[str, Any], key: str) -> Variant | None:
    """Return the point of a sweep that has a hash; None where no scenario gives it.

    Parameters
    ----------
    bases : sequence of Scenario
        Of the study.
    axes : mapping
        Values of the swept keys of the scenario.
    key : str
        Hash of the scenario at the point.
    """
    for base in bases:
        for common in (True, False):
            try:
                found = varied(base, axes, common=common)
            except ScenarioError:  # the axes are those of another scenario of the study
                continue
            if found.hash == key:
                return Variant(base, axes, key, found.duration, (), common)
    return None


@dataclass(frozen=True)
class Unit:
    """Work that one process does at a time: some seeds of variants that share their records.

    Attributes
    ----------
    variants : tuple of Variant
        Each with those of its estimators that are to be run.
    seeds : tuple of int
    repeat : int
        As in `simulate`: 0, or the number of another noise on the same runs.
    """

    variants: tuple[Variant, ...]
    seeds: tuple[int, ...]
    repeat: int = 0

    @property
    def cases(self) -> int:
        """Number of cases."""
        return sum(len(variant.entries) for variant in self.variants) * len(self.seeds)

    def __str__(self) -> str:
        seeds = f"{self.seeds[0]} … {self.seeds[-1]}" if self.seeds[1:] else str(self.seeds[0])
        first, *more = self.variants
        names = ", ".join(entry.text for entry in first.entries)
        others = f" and {len(more)} variants of it" if more else ""
        return f"{first.scenario().name}{others}, seeds {seeds}, {names}"
