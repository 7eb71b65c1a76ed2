"""What a worker does: simulate some seeds, run estimators on them, give back rows as text."""

from __future__ import annotations

import platform
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building import specs
from flexaxis.experiments.building.code import digest, own_digest
from flexaxis.experiments.building.guest import Remark, limited, noted
from flexaxis.experiments.running.batches import has_batch, run_batch
from flexaxis.experiments.running.cache import RecordCache, kept_runs, records
from flexaxis.experiments.running.case import case_id, run_case, warm
from flexaxis.experiments.running.compiling import COMPILING, compiled_apart
from flexaxis.experiments.running.files import dumps
from flexaxis.experiments.running.stopping import check, stoppable
from flexaxis.experiments.running.together import Together, ran_together
from flexaxis.experiments.running.traces import Trace
from flexaxis.experiments.running.units import Entry, Unit, Variant
from flexaxis.experiments.scoring.pooling import Case
from flexaxis.experiments.scoring.spending import ledger, spent
from flexaxis.experiments.scoring.table import undefined
from flexaxis.sim.errors import SimulationError
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import versions

Row = dict[str, Any]
ROWS = "rows as text"  # the account of what they take


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
    traces : tuple of Trace
        What trajectories are drawn from, where it was asked for.
    simulated : int
        Records that were not in the cache.
    simulating, estimating : float
        Time taken [s].
    remarks : tuple of Remark
        What is to be known of users' code.
    spent : mapping of str to float
        Processor time by account [s].
    """

    lines: bytes
    cases: int
    failed: int
    kept: tuple[Kept, ...] = ()
    traces: tuple[Trace, ...] = ()
    simulated: int = 0
    simulating: float = 0.0
    estimating: float = 0.0
    remarks: tuple[Remark, ...] = ()
    spent: Mapping[str, float] = field(default_factory=dict)


@dataclass
class _Done:
    """The cases of a unit, as they come: of each its rows, and what goes with them."""

    cases: list[tuple[list[Row], Kept | None, Trace | None]] = field(default_factory=list)
    simulated: int = 0
    simulating: float = 0.0
    estimating: float = 0.0

    def outcome(self, remarks: Sequence[Remark]) -> Outcome:
        """Return what became of the unit, as far as it has come."""
        rows = [rows for rows, _, _ in self.cases]
        with spent(ROWS):
            lines = "".join(dumps(row) + "\n" for case in rows for row in case).encode()
        return Outcome(
            lines=lines,
            cases=len(rows),
            failed=sum(case[0]["error"] is not None for case in rows),
            kept=tuple(kept for _, kept, _ in self.cases if kept is not None),
            traces=tuple(trace for _, _, trace in self.cases if trace is not None),
            simulated=self.simulated,
            simulating=self.simulating,
            estimating=self.estimating,
            remarks=tuple(remarks),
        )


def run_unit(
    unit: Unit,
    store: RecordCache | None = None,
    whole: bool = False,
    traced: bool = False,
    time_limit: float | None = None,
) -> Outcome:
    """Run the cases of a unit; one that fails is a row that says so.

    Where the work is stopped (`flexaxis.experiments.running.stopping`), the outcome has the cases
    that were done by then.

    Parameters
    ----------
    unit : Unit
    store : RecordCache, optional
        Where records are kept.
    whole : bool
        Whether to give back the estimates themselves too.
    traced : bool
        Whether to give back what trajectories are drawn from.
    time_limit : float, optional
        How long a user's estimator may take for a run [s].
    """
    # One thread: wherever it is run, to the last bit the same.
    done = _Done()
    with ledger() as seconds, threadpool_limits(1), limited(time_limit), noted() as remarks:
        with stoppable(), kept_runs(store), compiled_apart():
            check()
            _run(done, unit, store, whole, traced)
        found = done.outcome(remarks)
    return replace(found, spent=dict(seconds))


def _run(done: _Done, unit: Unit, store: RecordCache | None, whole: bool, traced: bool) -> None:
    started = time.perf_counter()
    found, failed, done.simulated = _records(unit, unit.seeds, store)
    between = time.perf_counter()
    done.simulating = between - started
    for variant in unit.variants:
        scenario = variant.scenario()
        for seed, text in failed.items():
            for entry in variant.entries:
                done.cases.append((_failure(variant, entry, seed, text, scenario.name), None, None))
        together = ran_together(scenario, [entry.text for entry in variant.entries], found)
        check()
        for entry in variant.entries:
            for rows, case in _cases(variant, scenario, entry, found, together):
                done.cases.append(_with_what_goes(rows, case, whole=whole, traced=traced))
                check()
    done.estimating = time.perf_counter() - between


def _records(
    unit: Unit, seeds: Sequence[int], store: RecordCache | None
) -> tuple[list[Record], dict[int, str], int]:
    """Return the records, for seeds that cannot be simulated the reason, and how many are new.

    All variants of a unit share them.
    """
    scenario = unit.variants[0].scenario()
    try:
        found, simulated = records(scenario, seeds, store, repeat=unit.repeat)
        return found, {}, simulated
    except SimulationError as error:
        if len(seeds) == 1:
            return [], {seeds[0]: f"SimulationError: {error}"}, 1
    # One run stops the batch it is in: each alone, so that the others are not lost with it.
    parts = [_records(unit, [seed], store) for seed in seeds]
    return (
        [record for part, _, _ in parts for record in part],
        {seed: text for _, failed, _ in parts for seed, text in failed.items()},
        sum(count for _, _, count in parts),
    )


def _cases(
    variant: Variant,
    scenario: Scenario,
    entry: Entry,
    found: Sequence[Record],
    together: Together,
) -> Iterator[tuple[list[Row], Case | None]]:
    """Yield the rows of each record, and what was scored; None for what could not be run."""
    spec, problem, batch = None, None, None
    try:
        spec = specs.parse(entry.text)
        whole = found and all(record.valid is None for record in found)
        if whole and has_batch(spec, scenario):
            batch = run_batch(scenario, found, spec)
        else:
            with spent(COMPILING):
                warm(spec, scenario)
    except EstimatorError as error:
        problem = error
    columns = _columns(variant, entry)
    for place, record in enumerate(found):
        ran = together.get((entry.text, place)) if batch is None else batch[place]
        failure, case = problem, None
        if spec is not None and failure is None:
            try:
                case = run_case(scenario, record, spec, whole=True, ran=ran)
            except EstimatorError as error:
                failure = error
        if case is None:
            text = f"{type(failure).__name__}: {failure}"
            yield _failure(variant, entry, record.seed or 0, text, scenario.name), None
            continue
        more = columns | {"rows": len(case.rows), "error": None}
        yield [row | more | {"cost": row["cost"] | {"versions": made_with()}}
               for row in case.rows], case  # fmt: skip


def _with_what_goes(
    rows: list[Row], case: Case | None, *, whole: bool, traced: bool
) -> tuple[list[Row], Kept | None, Trace | None]:
    if case is None:
        return rows, None, None
    first, kept, trace = rows[0], None, None
    if whole and case.theta is not None:
        period = first["seconds"] / len(case.theta)
        kept = Kept(first["case"], case.estimator, first["hash"], case.seed, period, case.names,
                    case.theta)  # fmt: skip
    if traced:
        trace = Trace(first["case"], first["hash"], case.estimator, case.names, case.curve,
                      case.relative, case.detail)  # fmt: skip
    return rows, kept, trace


def _failure(variant: Variant, entry: Entry, seed: int, problem: str, name: str) -> list[Row]:
    identity = {
        "case": case_id(variant.hash, entry.text, seed),
        "hash": variant.hash,
        "scenario": name,
        "estimator": entry.text,
        "seed": seed,
    }
    cost = {"us_per_sample": None, "seconds": None, "host": None, "versions": made_with()}
    more = _columns(variant, entry) | {"rows": 1, "error": problem}
    # A case that fails has one row, in which every score is null.
    return [identity | undefined() | {"cost": cost} | more]


def _columns(variant: Variant, entry: Entry) -> Row:
    """Return what stands in a row besides the case and its scores."""
    return {
        "base": variant.base.name,
        "method": entry.method,
        "axes": dict(variant.axes) | dict(entry.axes),
        "seconds": variant.duration,
        "code": digest(entry.text),
    }


@cache
def made_with() -> str:
    """Return what decides about the bits of a row: the machine's kind, versions, our own code."""
    parts = versions() | {name: version(name) for name in ("scipy", "numba")}
    words = [f"{name} {number}" for name, number in parts.items()]
    words.append(f"code {own_digest()}")
    return ", ".join([*words, platform.system(), platform.machine()])
