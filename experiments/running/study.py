"""Define studies with scenarios, estimators and seeds, and split them into units of work."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from hashlib import sha256
from itertools import product
from typing import Any

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.files import StudyError
from flexaxis.experiments.running import estimators
from flexaxis.experiments.scoring.parameter_names import check_model
from flexaxis.sim.errors import ScenarioError
from flexaxis.sim.scenario import Scenario

Point = dict[str, Any]
"""Values at one point of a sweep, keyed by the dotted names of the swept keys."""
ALL = "estimator"
"""Prefix of swept keys that set an option of every estimator."""
SEEDS_PER_UNIT = 16  # enough for efficient batches, but few enough to show progress
UNITS = 16  # smallest number of units (with enough records), so that many processes have work


@dataclass(frozen=True)
class Study:
    """A study that runs every estimator on every scenario, for every sweep point and seed.

    Attributes
    ----------
    name : str
        Name of the study.
    scenarios : tuple of Scenario
        Scenarios with different names.
    estimators : tuple of str
        Estimators, in the format of the option `--estimator`.
    seeds : tuple of int
        Seeds of the records.
    axes : tuple of str
        Names of the keys that the study sweeps. Without a sweep, the tuple is empty.
    points : tuple of dict
        Points of the sweep. Each sweep point contains a value for every swept key.
    streams : {"common", "own"}
        If `streams` is "common", all sweep points of a scenario use the same random numbers. If
        `streams` is "own", each sweep point uses different random numbers.

    Raises
    ------
    StudyError
        If two scenarios have the same name or the same content.
    """

    name: str
    scenarios: tuple[Scenario, ...]
    estimators: tuple[str, ...]
    seeds: tuple[int, ...]
    axes: tuple[str, ...] = ()
    points: tuple[Point, ...] = ({},)
    streams: str = "common"

    def __post_init__(self) -> None:
        for key in ("name", "hash"):
            every = [getattr(scenario, key) for scenario in self.scenarios]
            if twice := [s.name for s in self.scenarios if every.count(getattr(s, key)) > 1]:
                raise StudyError(
                    f"{self.name}: the scenarios {' and '.join(twice)} have the same {key}, so "
                    "their results could not be distinguished. Change or remove one of these "
                    "scenarios"
                )

    @property
    def cases(self) -> int:
        """Maximum number of runs in the study."""
        return math.prod(map(len, (self.scenarios, self.estimators, self.seeds, self.points)))

    @property
    def block(self) -> int:
        """Number of seeds in a unit of work, which is the same for all shards of a study."""
        records = len(self.scenarios) * len(self.points) * len(self.seeds)
        return min(SEEDS_PER_UNIT, max(1, records // UNITS))


@dataclass(frozen=True)
class Setting:
    """An estimator with its swept options at one sweep point.

    Attributes
    ----------
    estimator : str
        Estimator as written in the definition of the study.
    text : str
        Estimator with the swept options, in the format of the option `--estimator`.
    axes : mapping
        Values of the swept options, keyed by option name.
    spec : Spec
        Specification for `text`.
    """

    estimator: str
    text: str
    axes: Mapping[str, Any]
    spec: estimators.Spec


PlannedCase = tuple[str, Setting, int]
"""Identifier, estimator setting and seed of a run."""


@dataclass(frozen=True)
class Unit:
    """A unit of work, which runs all estimators on one scenario for a block of seeds.

    Attributes
    ----------
    scenario : Scenario
        Scenario with the swept values at one sweep point.
    base : str
        Name of the base scenario, to which the swept values are applied.
    axes : mapping
        Values of the swept scenario keys.
    settings : tuple of Setting
        Settings of the estimators.
    seeds : tuple of int
        Seeds of the records.
    done : frozenset of str
        Identifiers of finished runs, which are skipped.
    error : str
        Error message if the unit consists of a single run that is known to fail. Such a run is
        stored as failed, and is not executed again.
    """

    scenario: Scenario
    base: str
    axes: Mapping[str, Any]
    settings: tuple[Setting, ...]
    seeds: tuple[int, ...]
    done: frozenset[str] = frozenset()
    error: str = ""

    def cases(self) -> list[PlannedCase]:
        """Return all unfinished runs of this unit of work."""
        every = (
            (case_id(self.scenario.hash, setting, seed), setting, seed)
            for setting, seed in product(self.settings, self.seeds)
        )
        return [case for case in every if case[0] not in self.done]


def case_id(scenario_hash: str, setting: Setting, seed: int) -> str:
    """Return the identifier of a run, which is a 64-bit hash in hexadecimal notation."""
    text = f"{scenario_hash} {setting.text} {setting.spec.digest or ''} {seed} "
    return sha256(text.encode()).hexdigest()[:16]


def applies(key: str, estimator: str) -> bool:
    """Return whether a key such as "estimator.X" or "NAME.X" sets an option of the given estimator.

    Examples
    --------
    >>> applies("estimator.forgetting", "rpem-forgetting"), applies("ekf.walk", "imm")
    (True, False)
    """
    return key.rpartition(".")[0] in {ALL, estimator.partition("[")[0].strip()}


def is_option(key: str, names: Sequence[str]) -> bool:
    """Return whether a swept key sets an estimator option rather than a scenario key."""
    return any(applies(key, name) for name in (ALL, *names))


def units(study: Study) -> list[Unit]:
    """Split a study into units of work.

    Raises
    ------
    StudyError
        If a sweep point is invalid. The error message names the sweep point.
    """
    result = []
    for base, (key, settings) in product(study.scenarios, _settings(study).items()):
        axes = json.loads(key)
        with _named(study, axes):
            scenario = base.override(axes, inherit=study.streams == "common") if axes else base
            check_model(scenario)
        for first in range(0, len(study.seeds), study.block):
            seeds = study.seeds[first : first + study.block]
            result.append(Unit(scenario, base.name, axes, settings, seeds))
    return result


def _settings(study: Study) -> dict[str, tuple[Setting, ...]]:
    """Return the estimator settings, keyed by the swept scenario values in JSON format."""
    options = [key for key in study.axes if is_option(key, study.estimators)]
    result: dict[str, dict[str, Setting]] = {}
    for point in study.points:
        own = {key: value for key, value in point.items() if key not in options}
        here = result.setdefault(json.dumps(own), {})
        for name in study.estimators:
            axes = {key: point[key] for key in options if applies(key, name)}
            changes = {key.rpartition(".")[2]: value for key, value in axes.items()}
            with _named(study, axes):
                text = estimators.with_options(name, changes)
                here.setdefault(text, Setting(name, text, axes, estimators.parse(text)))
    return {key: tuple(settings.values()) for key, settings in result.items()}


@contextmanager
def _named(study: Study, axes: Point) -> Iterator[None]:
    """Add the name of the study and the swept values to an error message."""
    try:
        yield
    except (ScenarioError, EstimatorError) as error:
        point = ", ".join(f"{key} = {json.dumps(value)}" for key, value in axes.items())
        where = f"{study.name}: sweep: {point}: " if point else ""
        raise StudyError(f"{where}{error}") from error


def missing(every: Sequence[Unit], done: set[str]) -> Iterator[Unit]:
    """Yield all units with unfinished runs; no run occurs in more than one of these units."""
    planned = set(done)
    for unit in every:
        ids = {case for case, _, _ in unit.cases()}
        if not ids <= planned:
            yield replace(unit, done=frozenset(ids & planned))
            planned |= ids


def labels(unit: Unit, setting: Setting) -> dict[str, Any]:
    """Return the properties that all runs of an estimator setting on a scenario share."""
    return {
        "hash": unit.scenario.hash,
        "setting": setting.text,
        "code": setting.spec.digest,
        "scenario": unit.base,
        "estimator": setting.estimator,
        "axes": {**unit.axes, **setting.axes},
        "changes": unit.axes,
    }


def describe(study: Study, every: Sequence[Unit]) -> dict[str, Any]:
    """Return a description of the study, which is stored as JSON in the results folder.

    Parameters
    ----------
    study : Study
        Study to describe.
    every : sequence of Unit
        Units from `units`.
    """
    variants = {
        (unit.scenario.hash, setting.text): labels(unit, setting)
        for unit in every for setting in unit.settings
    }  # fmt: skip
    return {
        "name": study.name,
        "scenarios": [{"hash": s.hash, "definition": s.resolved()} for s in study.scenarios],
        "estimators": study.estimators,
        "seeds": study.seeds,
        "axes": study.axes,
        "streams": study.streams,
        "variants": list(variants.values()),
    }
