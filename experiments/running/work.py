"""What a worker does: simulate some seeds, run estimators on them, give back rows."""

from __future__ import annotations

import platform
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building import specs
from flexaxis.experiments.building.code import own_digest
from flexaxis.experiments.building.crashes import is_its_own
from flexaxis.experiments.building.guest import Remark, is_guest, limited, noted
from flexaxis.experiments.running.cache import RecordCache, kept_runs, records
from flexaxis.experiments.running.case import identity_of, run_case, warm
from flexaxis.experiments.running.interrupts import asked
from flexaxis.experiments.running.study import Entry, Unit, Variant
from flexaxis.experiments.scoring.case import failed_track
from flexaxis.experiments.scoring.summary import Case
from flexaxis.experiments.scoring.table import rows as score_rows
from flexaxis.experiments.scoring.table import undefined
from flexaxis.experiments.storage.errors import NotRun
from flexaxis.experiments.storage.traces import Trace
from flexaxis.sim.errors import SimulationError
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import versions

Row = dict[str, Any]


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
    rows : tuple of dict
        Of all its cases, those of one behind each other.
    cases, failed : int
        How many, and how many of them could not be run.
    kept : tuple of Kept
        Estimates, where they were asked for.
    traces : tuple of (dict, bytes)
        What trajectories are drawn from, where it was asked for, with a row of each case.
    simulated : int
        Records that were not in the cache.
    simulating, estimating : float
        Time taken [s].
    missing : tuple of str
        Why cases were not run, for no fault of their estimators: no memory, a full disk, a package
        that is not there.
    remarks : tuple of Remark
        What is to be known of users' code.
    """

    rows: tuple[Row, ...]
    cases: int
    failed: int
    kept: tuple[Kept, ...] = ()
    traces: tuple[tuple[Row, bytes], ...] = ()
    simulated: int = 0
    simulating: float = 0.0
    estimating: float = 0.0
    missing: tuple[str, ...] = ()
    remarks: tuple[Remark, ...] = ()


@dataclass
class _Done:
    """The cases of a unit, as they come: of each its rows, and what goes with them."""

    cases: list[tuple[list[Row], Kept | None, bytes | None]] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    simulated: int = 0
    simulating: float = 0.0
    estimating: float = 0.0

    def outcome(self, remarks: Sequence[Remark]) -> Outcome:
        """Return what became of the unit, as far as it has come."""
        return Outcome(
            rows=tuple(row for rows, _, _ in self.cases for row in rows),
            cases=len(self.cases),
            failed=sum(rows[0]["error"] is not None for rows, _, _ in self.cases),
            kept=tuple(kept for _, kept, _ in self.cases if kept is not None),
            traces=tuple((rows[0], trace) for rows, _, trace in self.cases if trace is not None),
            simulated=self.simulated,
            simulating=self.simulating,
            estimating=self.estimating,
            missing=tuple(self.missing),
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

    Where it is asked to end (`flexaxis.experiments.running.interrupts`), the outcome has the cases
    that were done by then; what is missing besides it says in `missing`.

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
    with threadpool_limits(1), limited(time_limit), noted() as remarks:
        with kept_runs(store):
            _run(done, unit, store, whole, traced)
        return done.outcome(remarks)


def _run(done: _Done, unit: Unit, store: RecordCache | None, whole: bool, traced: bool) -> None:
    started = time.perf_counter()
    found, failed, done.simulated = _records(unit, unit.seeds, store)
    between = time.perf_counter()
    done.simulating = between - started
    for variant in unit.variants:
        scenario = variant.scenario()
        for seed, text in failed.items():
            for entry in variant.entries:
                done.cases.append((_failure(variant, entry, scenario, seed, text), None, None))
        for entry in variant.entries:
            for rows, case in _cases(variant, scenario, entry, found, done.missing):
                done.cases.append(_with_what_goes(rows, case, whole=whole, traced=traced))
                if asked():
                    break
    done.estimating = time.perf_counter() - between


def died(unit: Unit) -> Outcome:
    """Return what became of a case whose process died twice, the second time alone.

    Raises
    ------
    NotRun
        If it is of no code of a user: then the system has ended it, as where memory runs out.
    """
    (variant,), (seed,) = unit.variants, unit.seeds
    (entry,), scenario = variant.entries, variant.scenario()
    what = "its process died: its code ended it, memory ran out, or it was killed"
    if not is_guest(entry.text):
        raise NotRun(f"{unit}: {what}")
    text = f"EstimatorCrash: {entry.text} crashed on {scenario.name}, seed {seed}: {what}"
    (record,), _, _ = _records(unit, [seed], None)
    rows = _failure(variant, entry, scenario, seed, text, record)
    return Outcome(tuple(rows), cases=1, failed=1)


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
    missing: list[str],
) -> Iterator[tuple[list[Row], Case | None]]:
    """Yield the rows of each record, and what was scored; None for what could not be run.

    Of what is for no fault of the estimator there is nothing; `missing` gets the reason.
    """
    spec, problem = None, None
    try:
        spec = specs.parse(entry.text)
        warm(spec, scenario)
    except EstimatorError as error:
        problem = error
    columns = _columns(variant, entry)
    for record in found:
        if asked():
            return
        failure, case = problem, None
        if spec is not None and failure is None:
            try:
                case = run_case(scenario, record, spec, whole=True)
            except EstimatorError as error:
                failure = error
        if failure is not None and not is_its_own(failure):
            missing.append(str(failure))
            continue
        if case is None:
            text = f"{type(failure).__name__}: {failure}"
            yield _failure(variant, entry, scenario, record.seed or 0, text, record), None
            continue
        more = columns | {"rows": len(case.rows), "error": None}
        yield [row | more | {"cost": row["cost"] | {"versions": made_with()}}
               for row in case.rows], case  # fmt: skip


def _with_what_goes(
    rows: list[Row], case: Case | None, *, whole: bool, traced: bool
) -> tuple[list[Row], Kept | None, bytes | None]:
    if case is None:
        return rows, None, None
    first, kept, trace = rows[0], None, None
    if whole and case.theta is not None:
        period = first["seconds"] / len(case.theta)
        kept = Kept(first["case"], case.estimator, first["hash"], case.seed, period, case.names,
                    case.theta)  # fmt: skip
    if traced and case.detail is not None:
        trace = Trace(case.estimator, case.names, case.curve, case.relative, case.detail).packed()
    return rows, kept, trace


def _failure(  # noqa: PLR0917
    variant: Variant, entry: Entry, scenario: Scenario, seed: int, problem: str,
    record: Record | None = None,
) -> list[Row]:  # fmt: skip
    """Return the rows of a case that failed: of a run lost at its first sample.

    Without a record nobody could have run: then there is one row, in which every score is null.
    """
    identity = identity_of(scenario, entry.text, seed)
    cost = {"us_per_sample": None, "seconds": None, "host": None, "versions": made_with()}
    found = [undefined()]
    if record is not None and record.true_parameters is not None:
        lost = failed_track(scenario.drawn(seed), record.true_parameters, record.torque)
        found = score_rows(lost) or found
    more = {"cost": cost} | _columns(variant, entry) | {"rows": len(found), "error": problem}
    return [identity | row | more for row in found]


def _columns(variant: Variant, entry: Entry) -> Row:
    """Return what stands in a row besides the case and its scores."""
    return {
        "base": variant.base.name,
        "method": entry.method,
        "axes": dict(variant.axes) | dict(entry.axes),
        "seconds": variant.duration,
        "code": entry.code,
    }


@cache
def made_with() -> str:
    """Return what decides about the bits of a row: the machine's kind, versions, our own code."""
    parts = versions() | {name: version(name) for name in ("scipy", "numba")}
    words = [f"{name} {number}" for name, number in parts.items()]
    words.append(f"code {own_digest()}")
    return ", ".join([*words, platform.system(), platform.machine()])
