"""What a worker does: simulate some seeds of a variant, run estimators, give back rows as text."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.running import specs
from flexaxis.experiments.running.cache import RecordCache, records
from flexaxis.experiments.running.files import dumps
from flexaxis.experiments.running.harness import case_id, run_case, warm
from flexaxis.experiments.running.plan import Entry, Unit, Variant
from flexaxis.experiments.scoring.table import undefined
from flexaxis.sim.errors import SimulationError
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import versions


@dataclass(frozen=True)
class Kept:
    """The estimates of a case, to be written to a file of their own."""

    case: str
    estimator: str
    hash: str
    seed: int
    period: float
    names: tuple[str, ...]
    theta: NDArray[np.float64]


@dataclass(frozen=True)
class Outcome:
    """What became of a unit.

    Attributes
    ----------
    lines : bytes
        Rows of all its cases, as they go to the file.
    cases, failed : int
        How many, and how many of them could not be run.
    kept : tuple of Kept
        Estimates, where they were asked for.
    simulating, estimating : float
        Time taken [s].
    """

    lines: bytes
    cases: int
    failed: int
    kept: tuple[Kept, ...]
    simulating: float
    estimating: float


def run_unit(unit: Unit, store: RecordCache | None = None, whole: bool = False) -> Outcome:
    """Run the cases of a unit; one that fails is a row that says so.

    Parameters
    ----------
    unit : Unit
    store : RecordCache, optional
        Where records are kept.
    whole : bool
        Whether to give back the estimates themselves too.
    """
    scenario = unit.variant.scenario()
    started = time.perf_counter()
    found, failed = _records(scenario, unit.seeds, store)
    simulated = time.perf_counter()
    cases = [
        _failure(unit.variant, entry, seed, text, scenario.name)
        for seed, text in failed.items()
        for entry in unit.entries
    ]
    kept: list[Kept] = []
    for entry in unit.entries:
        problem = _warmed(entry, scenario)
        for record in found:
            rows, estimates = _rows(unit.variant, scenario, entry, record, problem, whole)
            cases.append(rows)
            kept += estimates
    return Outcome(
        lines="".join(dumps(row) + "\n" for rows in cases for row in rows).encode(),
        cases=len(cases),
        failed=sum(rows[0]["error"] is not None for rows in cases),
        kept=tuple(kept),
        simulating=simulated - started,
        estimating=time.perf_counter() - simulated,
    )


def _records(
    scenario: Scenario, seeds: Sequence[int], store: RecordCache | None
) -> tuple[list[Record], dict[int, str]]:
    """Return the records, and for seeds that cannot be simulated the reason."""
    try:
        return records(scenario, seeds, store)[0], {}
    except SimulationError as error:
        if len(seeds) == 1:
            return [], {seeds[0]: f"SimulationError: {error}"}
    # One run stops the batch it is in: each alone, so that the others are not lost with it.
    parts = [_records(scenario, [seed], store) for seed in seeds]
    return [r for part, _ in parts for r in part], {k: v for _, f in parts for k, v in f.items()}


def _warmed(entry: Entry, scenario: Scenario) -> str | None:
    """Let an estimator compile what it compiles; return why it cannot be run here, if so."""
    try:
        warm(specs.parse(entry.text), scenario)
    except EstimatorError as error:
        return f"EstimatorError: {error}"
    return None


def _rows(  # noqa: PLR0917
    variant: Variant,
    scenario: Scenario,
    entry: Entry,
    record: Record,
    problem: str | None,
    whole: bool,
) -> tuple[list[dict[str, Any]], list[Kept]]:
    seed = record.seed or 0
    if problem is None:
        try:
            case = run_case(scenario, record, specs.parse(entry.text), whole=whole)
        except EstimatorError as error:
            problem = f"EstimatorError: {error}"
    if problem is not None:
        return _failure(variant, entry, seed, problem, scenario.name), []
    study = _study_columns(variant, entry) | {"rows": len(case.rows), "error": None}
    rows = [row | study | {"cost": row["cost"] | {"versions": made_with()}} for row in case.rows]
    if case.theta is None:
        return rows, []
    kept = Kept(rows[0]["case"], entry.text, variant.hash, seed, scenario.period, case.names,
                case.theta)  # fmt: skip
    return rows, [kept]


def _failure(
    variant: Variant, entry: Entry, seed: int, problem: str, name: str
) -> list[dict[str, Any]]:
    identity = {
        "case": case_id(variant.hash, entry.text, seed),
        "hash": variant.hash,
        "scenario": name,
        "estimator": entry.text,
        "seed": seed,
    }
    cost = {"us_per_sample": None, "seconds": None, "host": None, "versions": made_with()}
    study = _study_columns(variant, entry) | {"rows": 1, "error": problem}
    # A case that fails has one row, in which every score is null.
    return [identity | undefined() | {"cost": cost} | study]


def _study_columns(variant: Variant, entry: Entry) -> dict[str, Any]:
    return {
        "base": variant.base.name,
        "method": entry.method,
        "axes": dict(variant.axes) | dict(entry.axes),
        "seconds": variant.duration,
    }


@cache
def made_with() -> str:
    """Return what decides about the bits of a row: the machine's kind and the versions."""
    import platform

    parts = versions() | {name: version(name) for name in ("scipy", "numba")}
    words = [f"{name} {number}" for name, number in parts.items()]
    return ", ".join([*words, platform.system(), platform.machine()])
