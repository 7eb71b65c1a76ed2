"""Run a unit of work: simulate records, run estimators and score the estimates."""

import io
import json
import os
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.experiments.running.cache import RecordCache, keep_nominal_runs, records
from flexaxis.experiments.running.estimators import Spec, build
from flexaxis.experiments.running.study import PlannedCase, Unit, labels
from flexaxis.experiments.running.user_code import (
    PIPE,
    TIME_LIMIT,
    ended_after,
    is_of_the_machine,
    reported,
)
from flexaxis.experiments.scoring.control_benefit import tracking
from flexaxis.experiments.scoring.parameter_names import known_names
from flexaxis.experiments.scoring.score_table import rows, undefined
from flexaxis.experiments.scoring.scores import Track, failed_track
from flexaxis.experiments.scoring.summary import NUMBERS, Case, scored
from flexaxis.experiments.scoring.windows import claimed_at
from flexaxis.sim.errors import SimulationError
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.tables.events import first_onset
from flexaxis.sim.timing import sample_index

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Options:
    """Options of a worker process.

    Attributes
    ----------
    cache : RecordCache or None
        Cache of simulated records.
    traces : bool
        Whether to store the estimates as functions of time, for figures of single runs.
    time_limit : float
        Time limit for one run of a user's estimator [s].
    log : str
        Path of the file to which the traceback is written if a run exceeds the time limit.
    """

    cache: RecordCache | None = None
    traces: bool = False
    time_limit: float = TIME_LIMIT
    log: str = os.devnull


@dataclass(frozen=True, eq=False)
class Done:
    """The result of running one estimator on one record.

    Attributes
    ----------
    id : str
        Identifier of the run, from `case_id`.
    about : str
        JSON text of the properties that all runs of an estimator on a scenario share.
    seed : int
        Seed of the record.
    numbers : ndarray (p, n)
        Values of the columns that `NUMBERS` lists, with one row per parameter. An undefined value
        is NaN.
    isolation : str or None
        JSON text that lists, for each fault, the parameters that the estimator names as changed.
    error : str or None
        Error message if the run failed.
    trace : bytes or None
        Estimates as functions of time, as returned by `pack`, for figures of the run.
    """

    id: str
    about: str
    seed: int
    numbers: Array
    isolation: str | None
    error: str | None
    trace: bytes | None = None


Outcome = list[Done | str]
"""Result of each run in a unit of work, or the reason why the run could not be executed."""


def run_unit(unit: Unit, options: Options) -> Outcome:
    """Execute all runs of a unit of work, and return their results."""
    # With one thread, all workers produce bitwise equal rows.
    with threadpool_limits(1), keep_nominal_runs(options.cache), warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=UserWarning, module="flexaxis")
        seeds = list(dict.fromkeys(seed for _, _, seed in unit.cases()))
        known = _records(unit.scenario, seeds, options.cache)
        return [_run(unit, case, known[case[2]], options) for case in unit.cases()]


def simulate_units(units: Sequence[Unit], options: Options) -> None:
    """Simulate the records for the given units of work, and store the records in the cache."""
    for unit in units:
        seeds = list(dict.fromkeys(seed for _, _, seed in unit.cases()))
        _records(unit.scenario, seeds, options.cache)


def _records(
    scenario: Scenario, seeds: Sequence[int], cache: RecordCache | None
) -> dict[int, Record | str]:
    """Map each seed to its record, or to an error message if the simulation fails."""
    try:
        return dict(zip(seeds, records(scenario, seeds, cache), strict=True))
    except SimulationError as error:
        if len(seeds) == 1:
            return {seeds[0]: f"SimulationError: {error}"}
        return {seed: _records(scenario, [seed], cache)[seed] for seed in seeds}


def _run(unit: Unit, case: PlannedCase, record: Record | str, options: Options) -> Done | str:
    """Execute a run; return the result, or the reason why the run could not be executed."""
    _, setting, seed = case
    if isinstance(record, str):  # the simulation failed: return one row without scores
        return _done(unit, case, [undefined()], record)
    error = unit.error
    try:
        if not error:
            result = run_case(unit.scenario, record, setting.spec, options)
            return _done(unit, case, result.rows, None, pack(result) if options.traces else None)
    except EstimatorError as raised:
        if is_of_the_machine(raised):
            return str(raised)
        error = f"{type(raised).__name__}: {raised}"
    assert record.true_parameters is not None
    lost = failed_track(unit.scenario.drawn(seed), record.true_parameters, record.torque)
    return _done(unit, case, rows(lost), error)  # counts as diverged at the first sample


def run_case(scenario: Scenario, record: Record, spec: Spec, options: Options = Options()) -> Case:
    """Run an estimator on a record, and score the estimates.

    Raises
    ------
    EstimatorError
        If the estimator raises an exception or returns invalid values.
    """
    drawn = scenario.drawn(record.seed or 0)
    clock = time.perf_counter if spec.text.startswith(PIPE) else time.thread_time
    with ended_after(options.time_limit if spec.is_users else None, options.log):
        estimator = build(spec, drawn)
        start = clock()
        theta, claimed, innovations = follow(spec.text, estimator, drawn, record)
        seconds = clock() - start
        findings = getattr(estimator, "findings", None)
        track = track_of(drawn, record, estimator.names, theta, claimed, innovations, findings)
        if scenario.controller.adapt:
            with reported(spec.text, f"in the control loop of {drawn.name}, seed {record.seed}"):
                worth = tracking(scenario, record.seed or 0, build(spec, drawn))
            track = replace(track, tracking=worth)
    cost = {"us_per_sample": 1e6 * seconds / len(theta), "seconds": seconds}
    identity = {"scenario": scenario.name, "hash": scenario.hash, "estimator": spec.text,
                "seed": record.seed}  # fmt: skip
    return scored(track, written=scenario, identity=identity, cost=cost)


def follow(
    text: str, estimator: Estimator, scenario: Scenario, record: Record
) -> tuple[Array, Any, Array | None]:
    """Run an estimator on a record; return the estimates, and the covariance before the fault.

    Parameters
    ----------
    text : str
        Name of the estimator for error messages.
    estimator : Estimator
        Estimator in its initial state.
    scenario : Scenario
        Scenario of the record. The scenario determines the time of the first fault.
    record : Record
        Record with the torque and the measured outputs.

    Returns
    -------
    theta : ndarray (N, p)
        Estimates after each sample.
    claimed : ndarray (p, p) or None
        Covariance that the estimator reports before the first fault (see `claimed_at`).
    innovations : ndarray (N, 2) or None
        Innovations y − ŷ, and the innovation variances that the estimator reports.

    Raises
    ------
    EstimatorError
        If the estimator raises an exception or returns invalid values.
    """
    where, samples = f"on {scenario.name}, seed {record.seed}", len(record.time)
    y, claimed = getattr(record, estimator.output), None
    thetas, shown = [], list[Any]()
    # Pass the record in parts of one second, so that the parts do not reveal the time of the fault.
    size = sample_index(1.0, scenario.period) if hasattr(estimator, "covariance") else samples
    for first in range(0, samples, size):
        part = slice(first, min(first + size, samples))
        valid = None if record.valid is None else record.valid[part]
        with reported(text, where, first=first, period=scenario.period):
            thetas.append(run_estimator(estimator, record.torque[part], y[part], valid))
        shown.append(getattr(estimator, "innovations", None))
        if part.stop <= claimed_at(scenario) + 1:
            claimed = getattr(estimator, "covariance", None)
    theta = np.concatenate(thetas)
    innovations = None if shown[0] is None else np.concatenate(shown)
    outputs = {"estimates": (theta, len(estimator.names)), "`innovations`": (innovations, 2)}
    for what, (values, width) in outputs.items():
        if values is not None and values.shape != (samples, width):
            raise EstimatorError(
                f"{text}, {where}: the returned {what} have the shape {values.shape}, but must "
                f"have the shape {(samples, width)}, with one row per sample"
            )
    return theta, claimed, innovations


def track_of(  # noqa: PLR0917
    scenario: Scenario, record: Record, estimated: Sequence[str], theta: Array, claimed: Any,
    innovations: Array | None, findings: Sequence[Any] | None,
) -> Track:  # fmt: skip
    """Return the estimates and true values of all parameters whose initial true value is not zero.

    Parameters
    ----------
    scenario : Scenario
        Scenario with the fault onset that was drawn at random for `record`.
    record : Record
        A simulated record.
    estimated : sequence of str
        Names of all p estimated parameters.
    theta, claimed, innovations : ndarray or None
        Results of `follow`.
    findings : sequence or None
        Parameter changes that the estimator detected.
    """
    assert record.true_parameters is not None
    names = known_names(scenario, estimated)
    place = [list(estimated).index(name) for name in names]
    if np.shape(claimed) == (len(estimated), len(estimated)):
        claimed = np.asarray(claimed)[np.ix_(place, place)]
    known = {"claimed": claimed, "innovations": innovations, "findings": findings}
    return Track(scenario, names, theta[:, place], record.true_parameters, record.torque, **known)


def _done(
    unit: Unit, case: PlannedCase, lines: Sequence[Mapping[str, Any]], error: str | None,
    trace: bytes | None = None,
) -> Done:  # fmt: skip
    name, setting, seed = case
    about = labels(unit, setting) | {
        "seconds": unit.scenario.duration,
        "parameters": [line["parameter"] or "" for line in lines],
    }
    numbers, named = numbers_of(lines), lines[0].get("isolation")
    if unit.scenario.onset_spread is not None:
        onset = first_onset(unit.scenario.drawn(seed)) * unit.scenario.period
        numbers[:, NUMBERS.index("onset")] = onset
    isolation = None if named is None else json.dumps(named)
    return Done(name, json.dumps(about), seed, numbers, isolation, error, trace)


def numbers_of(lines: Sequence[Mapping[str, Any]]) -> Array:
    """Convert nested score rows to an array with columns `NUMBERS` and one row per parameter."""
    table = pd.json_normalize(list(lines)).reindex(columns=NUMBERS)
    return np.ascontiguousarray(table.to_numpy(float))


def pack(case: Case) -> bytes:
    """Return the parameter names and estimates of a run as the bytes of an .npz file."""
    buffer = io.BytesIO()
    np.savez(buffer, names=case.names, curve=case.curve, near=case.near)
    return buffer.getvalue()


def unpack(content: bytes) -> Case:
    """Return the parameter names and estimates of a run from the bytes that `pack` returned."""
    with np.load(io.BytesIO(content)) as stored:
        return Case(tuple(stored["names"].tolist()), stored["curve"], stored["near"])
