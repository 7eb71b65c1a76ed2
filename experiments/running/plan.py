"""From a study to units of work: which cases there are, and which are still to be run."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building import estimator_text as specs
from flexaxis.experiments.building.code import digest, names_code
from flexaxis.experiments.building.crashes import EstimatorCrash
from flexaxis.experiments.building.ready import ready
from flexaxis.experiments.running.case import case_id
from flexaxis.experiments.running.study import (
    EstimatorSetting,
    Point,
    Study,
    Unit,
    Variant,
    applies,
    in_words,
    is_option,
    varied,
)
from flexaxis.experiments.scoring.parameter_names import check_model
from flexaxis.experiments.storage.files import StudyError
from flexaxis.sim.errors import ScenarioError
from flexaxis.sim.scenario import Scenario

SEEDS_PER_UNIT = 16  # enough to share the cost of a batch, few enough to see progress
UNITS = 16  # at least that many where there are records enough, so that many processes have work
CASES_PER_UNIT = 256  # at most, where many variants share their records
MOST_CASES = 10**7  # of 1 to 2 kB
SHOWN = 20  # problems told at once


@dataclass(frozen=True)
class Work:
    """How much there is to do."""

    cases: int
    records: int


@dataclass(frozen=True)
class Plan:
    """All variants of a study, and which share of the work is ours.

    Attributes
    ----------
    study : Study
    groups : tuple of tuple of Variant
        Those that share their records together.
    shard : (int, int)
        Number of this share, from 1, and of all shares.
    repeat : int
        As in `Unit`.
    """

    study: Study
    groups: tuple[tuple[Variant, ...], ...]
    shard: tuple[int, int] = (1, 1)
    repeat: int = 0

    @property
    def variants(self) -> tuple[Variant, ...]:
        """All variants."""
        return tuple(variant for group in self.groups for variant in group)

    @property
    def block(self) -> int:
        """Seeds in a unit; it depends on the study alone, as does who gets which unit."""
        records = len(self.groups) * len(self.study.seeds)
        return min(SEEDS_PER_UNIT, max(1, records // UNITS))

    def units(self, done: NDArray[np.uint64] | None = None) -> Iterator[Unit]:
        """Yield the units of our share, without the cases that are done.

        Parameters
        ----------
        done : ndarray of uint64, sorted
            Cases that are not to be run again.
        """
        seeds, number = self.study.seeds, 0
        mine, shares = self.shard
        for group in self.groups:
            for first in range(0, len(seeds), self.block):
                some = seeds[first : first + self.block]
                for variants in _portions(group, len(some)):
                    if number % shares == mine - 1:
                        yield from _missing(Unit(variants, some, self.repeat), done)
                    number += 1

    @property
    def codes(self) -> dict[str, str | None]:
        """The estimators, at each setting, with the digests of their code."""
        return {entry.text: entry.code for v in self.variants for entry in v.entries}

    def work(self, done: NDArray[np.uint64] | None = None) -> Work:
        """Return how much there is to do."""
        units = [(unit.cases, len(unit.seeds)) for unit in self.units(done)]
        return Work(sum(cases for cases, _ in units), sum(records for _, records in units))


def _portions(group: tuple[Variant, ...], seeds: int) -> Iterator[tuple[Variant, ...]]:
    most = max(len(variant.entries) for variant in group) * seeds
    size = max(1, CASES_PER_UNIT // max(1, most))
    for first in range(0, len(group), size):
        yield group[first : first + size]


def _missing(unit: Unit, done: NDArray[np.uint64] | None) -> Iterator[Unit]:
    """Yield what is missing of a unit: itself, or a part for each set of cases missing."""
    if done is None or not done.size:
        yield unit
        return
    sets: dict[tuple[bool, ...], list[int]] = {}
    pairs = [(variant, entry) for variant in unit.variants for entry in variant.entries]
    for seed in unit.seeds:
        names = [case_id(variant.hash, entry.text, seed) for variant, entry in pairs]
        ids = np.array([int(name, 16) for name in names], np.uint64)
        there = done[np.minimum(np.searchsorted(done, ids), done.size - 1)] == ids
        sets.setdefault(tuple(there.tolist()), []).append(seed)
    for known, some in sets.items():
        lacking: dict[str, tuple[Variant, list[EstimatorSetting]]] = {}
        for (variant, entry), there in zip(pairs, known, strict=True):
            if not there:
                lacking.setdefault(variant.hash, (variant, []))[1].append(entry)
        variants = tuple(replace(v, entries=tuple(e)) for v, e in lacking.values())
        if variants:
            yield replace(unit, variants=variants, seeds=tuple(some))


def make_plan(
    study: Study, *, shard: tuple[int, int] = (1, 1), repeat: int = 0, run_code: bool = False
) -> Plan:
    """Return the plan of a study; every variant and every estimator is tried on the way.

    Parameters
    ----------
    study : Study
    shard : (int, int)
        As in `Plan`.
    repeat : int
        As in `Unit`.
    run_code : bool
        Whether to try estimators that name code, too; else the plan is made without running it.

    Raises
    ------
    StudyError
        With one line for each problem, naming the point of the sweep.
    EstimatorCrash
        If the code of an estimator raises something when it is made.
    """
    _check_size(study)
    for base in study.scenarios:
        check_model(base)
    groups: dict[str, dict[str, Variant]] = {}
    problems = _Problems(study)
    entries = _entries(study, problems, run_code)
    common = study.streams == "common"
    for base in study.scenarios:
        for key, texts in entries.items():
            axes = json.loads(key)
            try:
                scenario = varied(base, axes, common=common)
                check_model(scenario)
            except ScenarioError as error:
                for problem in error.problems:
                    problems.add(problem.removeprefix(f"{base.name}: "), in_words(axes))
                continue
            group = groups.setdefault(scenario.record_hash, {})
            # Two points may define the same run: then it is one variant, with all estimators.
            new = Variant(base, axes, scenario.hash, scenario.duration, (), common)
            known = group.get(scenario.hash, new)
            all_of_it = {entry.text: entry for entry in known.entries} | texts
            group[scenario.hash] = replace(known, entries=tuple(all_of_it.values()))
        _try_estimators(base, entries, problems, run_code)
    problems.tell()
    made = tuple(tuple(group.values()) for group in groups.values())
    return Plan(study, made, shard, repeat)


def _check_size(study: Study) -> None:
    """Refuse what would fill any disk with rows; some cases may be the same one, and run once."""
    sizes = {
        "scenarios": len(study.scenarios),
        "points": len(study.points),
        "estimators": len(study.estimators),
        "seeds": len(study.seeds),
    }
    if math.prod(sizes.values()) > MOST_CASES:
        told = " × ".join(f"{number} {name}" for name, number in sizes.items())
        raise StudyError(
            f"{study.name}: {told} are too many cases: at most {MOST_CASES:,} in all, whose rows "
            "take some 20 GB; make it smaller, or several of it"
        )


class _Problems:
    """What is wrong with a study: each once, with the first point at which it is."""

    def __init__(self, study: Study) -> None:
        self._name, self._found, self._crashed = study.name, dict[str, str](), False

    def add(self, problem: str | Exception, where: str) -> None:
        self._crashed |= isinstance(problem, EstimatorCrash)
        self._found.setdefault(str(problem), where)

    def tell(self) -> None:
        """Raise if there is anything to tell."""
        if not self._found:
            return
        told = [
            f"{self._name}: sweep: {where}: {text}" if where else text
            for text, where in list(self._found.items())[:SHOWN]
        ]
        more = len(self._found) - len(told)
        text = "\n".join(told + ([f"… and {more} more"] if more else []))
        raise EstimatorCrash(text) if self._crashed else StudyError(text)


def _entries(
    study: Study, problems: _Problems, run_code: bool
) -> dict[str, dict[str, EstimatorSetting]]:
    """Return for each point of the scenario axes the estimators, by their text."""
    options = [key for key in study.axes if is_option(key, study.estimators)]
    codes = {method: digest(method) for method in study.estimators}
    found: dict[str, dict[str, EstimatorSetting]] = {}
    for point in study.points:
        # Points are told apart as text, for a value may be an array.
        mine = found.setdefault(
            json.dumps({k: v for k, v in point.items() if k not in options}), {}
        )
        for method in study.estimators:
            axes = {key: point[key] for key in options if applies(key, method)}
            try:
                entry = EstimatorSetting(method, _text(method, axes, run_code), axes, codes[method])
            except EstimatorError as error:
                problems.add(error, in_words(axes))
            else:
                mine.setdefault(entry.text, entry)
    return found


def _text(method: str, axes: Point, run_code: bool) -> str:
    """Return the text of an estimator with options set: "rpem-forgetting[forgetting=0.99]"."""
    text = method
    if axes:
        given = {key.rpartition(".")[2]: value for key, value in axes.items()}
        options = specs.written_options(method) | given
        inside = ",".join(f"{key}={json.dumps(value)}" for key, value in options.items())
        text = f"{method.partition('[')[0].strip()}[{inside}]"
    if run_code or not names_code(text):
        specs.parse(text)  # an unknown estimator or option is told with the nearest right one
    return text


def _try_estimators(
    base: Scenario,
    entries: Mapping[str, Mapping[str, EstimatorSetting]],
    problems: _Problems,
    run_code: bool,
) -> None:
    for text, entry in {t: e for texts in entries.values() for t, e in texts.items()}.items():
        if names_code(text) and not run_code:
            continue
        try:
            ready(specs.parse(text), base)
        except EstimatorError as error:
            problems.add(error, in_words(entry.axes))


def expected(plan: Plan) -> int:
    """Return the number of cases of the whole study, whatever our share of it."""
    entries: Sequence[int] = [len(variant.entries) for variant in plan.variants]
    return sum(entries) * len(plan.study.seeds)
