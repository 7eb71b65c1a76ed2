"""From a study to units of work: which cases there are, and which are still to be run."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.running import specs
from flexaxis.experiments.running.consent import names_code
from flexaxis.experiments.running.harness import SEEDS_PER_TASK, case_id
from flexaxis.experiments.studies.definition import (
    SHOWN,
    Study,
    StudyError,
    applies,
    is_option,
)
from flexaxis.experiments.studies.design import Point
from flexaxis.sim.errors import ScenarioError
from flexaxis.sim.scenario import Scenario

UNITS = 32  # at least that many where there are records enough, so that many processes have work


@dataclass(frozen=True)
class Entry:
    """An estimator at one setting of its swept options.

    Attributes
    ----------
    method : str
        As it stands in the study.
    text : str
        With the options set.
    axes : dict
        The options, by their swept keys.
    """

    method: str
    text: str
    axes: Mapping[str, Any]


@dataclass(frozen=True)
class Variant:
    """A scenario at one setting of its swept keys, and the estimators that get its records."""

    base: Scenario
    axes: Mapping[str, Any]
    hash: str
    duration: float
    entries: tuple[Entry, ...]

    def scenario(self) -> Scenario:
        """Return the scenario: made when it is needed, for a plan may hold many."""
        return self.base.override(self.axes) if self.axes else self.base


@dataclass(frozen=True)
class Unit:
    """Work that one process does at a time: some seeds of a variant, for some estimators."""

    variant: Variant
    entries: tuple[Entry, ...]
    seeds: tuple[int, ...]

    @property
    def cases(self) -> int:
        """Number of cases."""
        return len(self.entries) * len(self.seeds)

    def __str__(self) -> str:
        seeds = f"{self.seeds[0]} … {self.seeds[-1]}" if self.seeds[1:] else str(self.seeds[0])
        names = ", ".join(entry.text for entry in self.entries)
        return f"{self.variant.scenario().name}, seeds {seeds}, {names}"


@dataclass(frozen=True)
class Work:
    """How much there is to do: cases, records and seconds of simulated axis."""

    cases: int = 0
    records: int = 0
    seconds: float = 0.0


@dataclass(frozen=True)
class Plan:
    """All variants of a study, and which share of the work is ours.

    Attributes
    ----------
    study : Study
    variants : tuple of Variant
    shard : (int, int)
        Number of this share, from 1, and of all shares.
    """

    study: Study
    variants: tuple[Variant, ...]
    shard: tuple[int, int] = (1, 1)

    @property
    def block(self) -> int:
        """Seeds in a unit; it depends on the study alone, as does who gets which unit."""
        records = len(self.variants) * len(self.study.seeds)
        return min(SEEDS_PER_TASK, max(1, records // UNITS))

    def units(self, done: NDArray[np.uint64] | None = None) -> Iterator[Unit]:
        """Yield the units of our share, without the cases that are done.

        Parameters
        ----------
        done : ndarray of uint64, sorted
            Cases that are not to be run again.
        """
        seeds, number = self.study.seeds, 0
        mine, shares = self.shard
        for variant in self.variants:
            for first in range(0, len(seeds), self.block):
                if number % shares == mine - 1:
                    yield from _missing(variant, seeds[first : first + self.block], done)
                number += 1

    def work(self, done: NDArray[np.uint64] | None = None) -> Work:
        """Return how much there is to do."""
        cases, records, seconds = 0, 0, 0.0
        for unit in self.units(done):
            cases += unit.cases
            records += len(unit.seeds)
            seconds += len(unit.seeds) * unit.variant.duration
        return Work(cases, records, seconds)


def _missing(
    variant: Variant, seeds: tuple[int, ...], done: NDArray[np.uint64] | None
) -> Iterator[Unit]:
    """Yield what is missing of a block: one unit, or one for each set of estimators missing."""
    if done is None or not done.size:
        yield Unit(variant, variant.entries, seeds)
        return
    groups: dict[tuple[bool, ...], list[int]] = {}
    for seed in seeds:
        names = [case_id(variant.hash, entry.text, seed) for entry in variant.entries]
        ids = np.array([int(name, 16) for name in names], np.uint64)
        there = done[np.minimum(np.searchsorted(done, ids), done.size - 1)] == ids
        groups.setdefault(tuple(there.tolist()), []).append(seed)
    for known, some in groups.items():
        if not all(known):
            lacking = (e for e, there in zip(variant.entries, known, strict=True) if not there)
            yield Unit(variant, tuple(lacking), tuple(some))


def make_plan(study: Study, *, shard: tuple[int, int] = (1, 1), run_code: bool = False) -> Plan:
    """Return the plan of a study; every variant and every estimator is tried on the way.

    Parameters
    ----------
    study : Study
    shard : (int, int)
        As in `Plan`.
    run_code : bool
        Whether to try estimators that name code, too; else the plan is made without running it.

    Raises
    ------
    StudyError
        With one line for each problem, naming the point of the sweep.
    """
    variants: dict[str, Variant] = {}
    problems: dict[str, str] = {}  # by what is wrong: the first point tells it
    entries = _entries(study, problems, run_code)
    for base in study.scenarios:
        for key, texts in entries.items():
            axes = json.loads(key)
            try:
                scenario = base.override(axes) if axes else base
            except ScenarioError as error:
                for problem in error.problems:
                    text = problem.removeprefix(f"{base.name}: ")
                    problems.setdefault(text, f"{words(axes)}: {text}")
                continue
            # Two points may define the same run: then it is one variant, with all estimators.
            known = variants.get(scenario.hash, Variant(base, axes, scenario.hash, 0.0, ()))
            all_of_it = {entry.text: entry for entry in known.entries} | texts
            variants[scenario.hash] = replace(
                known, duration=scenario.duration, entries=tuple(all_of_it.values())
            )
        _try_estimators(base, entries, problems, run_code)
    if problems:
        more = len(problems) - SHOWN
        told = [f"{study.name}: sweep: {text}" for text in list(problems.values())[:SHOWN]]
        raise StudyError("\n".join(told + ([f"… and {more} more"] if more > 0 else [])))
    return Plan(study, tuple(variants.values()), shard)


def _entries(study: Study, problems: dict[str, str], run_code: bool) -> dict[str, dict[str, Entry]]:
    """Return for each point of the scenario axes the estimators, by their text."""
    options = [key for key in study.axes if is_option(key, study.estimators)]
    found: dict[str, dict[str, Entry]] = {}
    for point in study.points:
        # Points are told apart as text, for a value may be an array.
        mine = found.setdefault(
            json.dumps({k: v for k, v in point.items() if k not in options}), {}
        )
        for method in study.estimators:
            axes = {key: point[key] for key in options if applies(key, method)}
            try:
                entry = Entry(method, _text(method, axes, run_code), axes)
            except EstimatorError as error:
                problems.setdefault(str(error), f"{words(axes)}: {error}")
            else:
                mine.setdefault(entry.text, entry)
    return found


def _text(method: str, axes: Point, run_code: bool) -> str:
    """Return the text of an estimator with options set: "rpem-forgetting[forgetting=0.99]"."""
    if not axes:
        return method
    given = {key.rpartition(".")[2]: value for key, value in axes.items()}
    options = specs.written_options(method) | given
    inside = ",".join(f"{key}={json.dumps(value)}" for key, value in options.items())
    text = f"{method.partition('[')[0].strip()}[{inside}]"
    if run_code or not names_code(text):
        specs.parse(text)  # an unknown option is told with the nearest right one
    return text


def _try_estimators(
    base: Scenario,
    entries: Mapping[str, Mapping[str, Entry]],
    problems: dict[str, str],
    run_code: bool,
) -> None:
    for text, entry in {t: e for texts in entries.values() for t, e in texts.items()}.items():
        if names_code(text) and not run_code:
            continue
        try:
            specs.build(specs.parse(text), base)
        except EstimatorError as error:
            problems.setdefault(str(error), f"{words(entry.axes) or 'estimators'}: {error}")


def words(axes: Mapping[str, Any]) -> str:
    """Return a point in words: "fault[0].factor = 1.5, start = 1.2"."""
    return ", ".join(f"{key} = {json.dumps(value)}" for key, value in axes.items())
