"""What a worker does: simulate some seeds, run estimators on them, give back rows."""

from __future__ import annotations

import platform
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from typing import Any

from threadpoolctl import threadpool_limits

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building import estimator_text as specs
from flexaxis.experiments.building.away import Died
from flexaxis.experiments.building.code import own_digest
from flexaxis.experiments.building.crashes import EstimatorCrash, is_its_own
from flexaxis.experiments.building.guest import Remark, limited, noted
from flexaxis.experiments.building.interrupts import asked
from flexaxis.experiments.running.cache import RecordCache, kept_runs
from flexaxis.experiments.running.cache import records as simulated_or_kept
from flexaxis.experiments.running.case import identity_of, run_case, warm
from flexaxis.experiments.running.study import EstimatorSetting, Unit, Variant
from flexaxis.experiments.scoring.score_table import rows as score_rows
from flexaxis.experiments.scoring.score_table import undefined
from flexaxis.experiments.scoring.scores import failed_track
from flexaxis.experiments.scoring.summary import Case
from flexaxis.experiments.storage.traces import packed
from flexaxis.sim.errors import SimulationError
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import versions

Row = dict[str, Any]


@dataclass
class Outcome:
    """What became of a unit, as far as it has come.

    Attributes
    ----------
    rows : sequence of dict
        Of all its cases, those of one behind each other.
    cases, failed : int
        How many, and how many of them could not be run.
    kept : list of (dict, Case)
        Cases with their estimates, where they were asked for, each with a row.
    traces : list of (dict, bytes)
        What trajectories are drawn from, where it was asked for, with a row of each case.
    simulated : int
        Records that were not in the cache.
    missing : list of str
        Why cases were not run, for no fault of their estimators: no memory, a full disk, a package
        that is not there.
    remarks : sequence of Remark
        What is to be known of users' code.
    """

    rows: list[Row] = field(default_factory=list)
    cases: int = 0
    failed: int = 0
    kept: list[tuple[Row, Case]] = field(default_factory=list)
    traces: list[tuple[Row, bytes]] = field(default_factory=list)
    simulated: int = 0
    missing: list[str] = field(default_factory=list)
    remarks: Sequence[Remark] = ()

    def add(self, rows: Sequence[Row]) -> None:
        """Add the rows of a case."""
        self.rows += rows
        self.cases += 1
        self.failed += rows[0]["error"] is not None


def run_unit(
    unit: Unit,
    store: RecordCache | None = None,
    whole: bool = False,
    traced: bool = False,
    time_limit: float | None = None,
) -> Outcome:
    """Run the cases of a unit; one that fails is a row that says so.

    Where it is asked to end (`flexaxis.experiments.building.interrupts`), the outcome has the cases
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
    found = Outcome()
    # One thread: wherever it is run, to the last bit the same.
    with (threadpool_limits(1), limited(time_limit), noted() as found.remarks, kept_runs(store),
          warnings.catch_warnings()):  # fmt: skip
        warnings.filterwarnings("ignore", category=UserWarning, module="flexaxis")  # told by a plan
        records, failed, found.simulated = _records(unit, unit.seeds, store)
        for variant in unit.variants:
            scenario = variant.scenario()
            for seed, text in failed.items():
                for entry in variant.entries:
                    found.add(_failure(variant, entry, scenario, seed, text))
            for entry in variant.entries:
                for rows, case in _cases(variant, scenario, entry, records, found.missing):
                    found.add(rows)
                    if case is not None and whole:
                        found.kept.append((rows[0], case))
                    if case is not None and traced:
                        found.traces.append((rows[0], packed(case)))
                    if asked():
                        break
    return found


def _records(
    unit: Unit, seeds: Sequence[int], store: RecordCache | None
) -> tuple[list[Record], dict[int, str], int]:
    """Return the records, for seeds that cannot be simulated the reason, and how many are new.

    All variants of a unit share them.
    """
    scenario = unit.variants[0].scenario()
    try:
        found, simulated = simulated_or_kept(scenario, seeds, store, repeat=unit.repeat)
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
    entry: EstimatorSetting,
    found: Sequence[Record],
    missing: list[str],
) -> Iterator[tuple[list[Row], Case | None]]:
    """Yield the rows of each record, and what was scored; None for what could not be run.

    Of what is for no fault of the estimator there is nothing; `missing` gets the reason.
    """
    spec, problem = None, None
    try:
        spec = specs.parse(entry.text)
        _again(warm, spec, scenario)
    except EstimatorError as error:
        problem = error
    columns = _columns(variant, entry)
    for record in found:
        if asked():
            return
        failure, case = problem, None
        if spec is not None and failure is None:
            try:
                case = _again(run_case, scenario, record, spec)
            except EstimatorError as error:
                failure = error
        if failure is not None and not is_its_own(failure):
            missing.append(str(failure))
            continue
        if case is None:
            crashed = isinstance(failure, EstimatorCrash)
            text = f"{EstimatorCrash.__name__ if crashed else type(failure).__name__}: {failure}"
            yield _failure(variant, entry, scenario, record.seed or 0, text, record), None
            continue
        more = columns | {"rows": len(case.rows), "error": None}
        yield [row | more | {"cost": row["cost"] | {"versions": made_with()}}
               for row in case.rows], case  # fmt: skip


def _again(run: Callable[..., Any], *args: Any) -> Any:
    """Run, and once more where the process of a user's code dies: the system may have ended it."""
    try:
        return run(*args)
    except Died:
        return run(*args)


def _failure(  # noqa: PLR0917
    variant: Variant, entry: EstimatorSetting, scenario: Scenario, seed: int, problem: str,
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


def _columns(variant: Variant, entry: EstimatorSetting) -> Row:
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
