"""What a worker does with a unit: simulate its records, run its estimators, score the estimates."""

from __future__ import annotations

import io
import json
import os
import platform
import time
import warnings
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.experiments.running.cache import RecordCache, keep_nominal_runs, records
from flexaxis.experiments.running.estimate import write_estimates
from flexaxis.experiments.running.estimators import Spec, build
from flexaxis.experiments.running.study import PlannedCase, Unit
from flexaxis.experiments.running.user_code import (
    PIPE,
    TIME_LIMIT,
    ended_after,
    is_of_the_machine,
    reported,
)
from flexaxis.experiments.scoring.curves import Detail
from flexaxis.experiments.scoring.parameter_names import known_names
from flexaxis.experiments.scoring.recovered import tracking
from flexaxis.experiments.scoring.score_table import columns, rows, undefined
from flexaxis.experiments.scoring.scores import Track, failed_track
from flexaxis.experiments.scoring.summary import Case, scored
from flexaxis.experiments.scoring.windows import claimed_at
from flexaxis.sim.errors import SimulationError
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.tables.events import first_onset
from flexaxis.sim.timing import sample_index

Array = NDArray[np.float64]
NUMBERS = (
    "changed", *(name for name, kind in columns().items() if kind != "text"),
    "onset", "cost.us_per_sample", "cost.seconds",
)  # fmt: skip
"""The columns of a row that are numbers, in the order in which they are stored."""


@dataclass(frozen=True)
class Options:
    """How a worker runs cases.

    Attributes
    ----------
    cache : RecordCache or None
        Where records are kept.
    traces : bool
        Whether to keep what the figures of single runs need.
    trajectories : Path or None
        Folder for all estimates of each case.
    time_limit : float
        Of one run of a user's estimator [s].
    log : str
        File for the traceback of a run that takes longer.
    """

    cache: RecordCache | None = None
    traces: bool = False
    trajectories: Path | None = None
    time_limit: float = TIME_LIMIT
    log: str = os.devnull


@dataclass(frozen=True, eq=False)
class Done:
    """A case that was run.

    Attributes
    ----------
    id : str
    about : str
        JSON of what the cases of an estimator on a scenario have in common, parameters included.
    seed : int
    numbers : ndarray (p, n)
        Columns `NUMBERS`; NaN is not defined.
    isolation : str or None
        JSON of what was named for each fault.
    error : str or None
        Why the case failed.
    trace : bytes or None
        A case without its rows, as from `pack`.
    """

    id: str
    about: str
    seed: int
    numbers: Array
    isolation: str | None
    error: str | None
    host: str
    trace: bytes | None = None


@dataclass
class Outcome:
    """What became of a unit.

    Attributes
    ----------
    cases : list of Done
    missing : list of str
        Why cases were not run through no fault of their estimators.
    simulated : int
        Records that were not in the cache.
    remarks : list of (str, str)
        Estimators of users that returned values that are not finite, and where.
    """

    cases: list[Done] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    simulated: int = 0
    remarks: list[tuple[str, str]] = field(default_factory=list)


def run_unit(unit: Unit, options: Options, stop: Any = None) -> Outcome:
    """Run the cases of a unit.

    Parameters
    ----------
    unit : Unit
    options : Options
    stop : event, optional
        When it is set, the unit ends after the current case.
    """
    outcome, failed = Outcome(), dict[int, str]()
    cases = unit.cases()
    seeds = list(dict.fromkeys(seed for _, _, seed in cases))
    # One thread, so that rows are equal to the last bit wherever they are made.
    with threadpool_limits(1), keep_nominal_runs(options.cache), warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=UserWarning, module="flexaxis")
        made = _records(unit, seeds, options.cache, outcome, failed)
        known = {record.seed: record for record in made}
        for case in cases:
            _, setting, seed = case
            if stop is not None and stop.is_set():
                break
            if reason := failed.get(seed) or unit.error:
                outcome.cases.append(failure(unit, case, reason, known.get(seed)))
                continue
            try:
                found = run_case(unit.scenario, known[seed], setting.spec, options)
            except EstimatorError as error:
                if is_of_the_machine(error):
                    outcome.missing.append(str(error))
                    continue
                text = f"{type(error).__name__}: {error}"
                done = failure(unit, case, text, known[seed])
            else:
                done = _done(unit, case, found, options)
                _note_not_finite(outcome, setting.spec, unit, seed, found)
            outcome.cases.append(done)
    return outcome


def _records(
    unit: Unit, seeds: Sequence[int], cache: RecordCache | None, outcome: Outcome,
    failed: dict[int, str],
) -> list[Record]:  # fmt: skip
    """Return the records of some seeds; if one stops its batch, each is simulated alone."""
    try:
        found, simulated = records(unit.scenario, seeds, cache, repeat=unit.repeat)
        outcome.simulated += simulated
        return found
    except SimulationError as error:
        if len(seeds) == 1:
            failed[seeds[0]] = f"SimulationError: {error}"
            return []
    alone = [_records(unit, [seed], cache, outcome, failed) for seed in seeds]
    return [record for each in alone for record in each]


def run_case(scenario: Scenario, record: Record, spec: Spec, options: Options = Options()) -> Case:
    """Run an estimator on a record and score it.

    Raises
    ------
    EstimatorError
        If the estimator raises an exception, or returns what it must not.
    """
    drawn = scenario.drawn(record.seed or 0)
    watched = spec.is_users and not spec.text.startswith(PIPE)
    with ended_after(options.time_limit, options.log) if watched else nullcontext():
        estimator = build(spec, drawn)
        clock = time.perf_counter if spec.text.startswith(PIPE) else time.thread_time
        start = clock()
        theta, claimed, innovations = follow(spec.text, estimator, drawn, record)
        seconds = clock() - start
        findings = getattr(estimator, "findings", None)
        track = track_of(drawn, record, estimator.names, theta, claimed, innovations, findings)
        if scenario.controller.adapt:
            with reported(spec.text, f"in the loop of {drawn.name}, seed {record.seed}"):
                worth = tracking(scenario, record.seed or 0, build(spec, drawn))
            track = replace(track, tracking=worth)
    cost = {"us_per_sample": 1e6 * seconds / len(theta), "seconds": seconds}
    identity = {"scenario": scenario.name, "hash": scenario.hash, "estimator": spec.text,
                "seed": record.seed}  # fmt: skip
    return scored(track, estimator=spec.text, written=scenario, identity=identity, cost=cost)


def follow(
    text: str, estimator: Estimator, scenario: Scenario, record: Record
) -> tuple[Array, Any, Array | None]:
    """Run an estimator on a whole record, and keep what it claims.

    Parameters
    ----------
    text : str
        Its name, for messages.
    estimator : Estimator
    scenario : Scenario
        For the first fault.
    record : Record

    Returns
    -------
    theta : ndarray (N, p)
    claimed : ndarray (p, p) or None
        Covariance before the first fault, as `claimed_at` defines it.
    innovations : ndarray (N, 2) or None
        y − ŷ and its claimed variance.

    Raises
    ------
    EstimatorError
        If the estimator raises an exception, or returns what it must not.
    """
    where, samples = f"on {scenario.name}, seed {record.seed}", len(record.time)
    y, claimed = getattr(record, estimator.output), None
    thetas, innovations = [], []
    # In seconds, so that the estimator does not learn from a cut when the fault comes.
    size = sample_index(1.0, scenario.period) if hasattr(estimator, "covariance") else samples
    for first in range(0, samples, size):
        part = slice(first, min(first + size, samples))
        u, valid = record.torque[part], None if record.valid is None else record.valid[part]
        with reported(text, where, first=first, period=scenario.period):
            theta = run_estimator(estimator, u, y[part], valid)
        if theta.shape != (len(u), len(estimator.names)):
            raise EstimatorError(
                f"{text} returned estimates of the shape {theta.shape} {where}; "
                f"{(len(u), len(estimator.names))} is needed: one row a sample, one column a name"
            )
        thetas.append(theta)
        innovations.append(_innovations(text, estimator, len(u), where))
        if part.stop <= claimed_at(scenario) + 1:
            claimed = getattr(estimator, "covariance", None)
    known = [each for each in innovations if each is not None]
    whole = np.concatenate(known) if len(known) == len(innovations) else None
    return np.concatenate(thetas), claimed, whole


def _innovations(text: str, estimator: Any, samples: int, where: str) -> Array | None:
    """Return innovation and claimed variance (N, 2) of the last run, None if it shows none."""
    try:
        found = np.array(getattr(estimator, "innovations", None), float)  # a copy
    except (TypeError, ValueError):
        return None  # the user has something else under this name
    if found.ndim != 2 or found.shape[1] != 2:
        return None
    if len(found) != samples:
        raise EstimatorError(
            f"{text} has `innovations` of the shape {found.shape} after a run of {samples} samples "
            f"{where}; {(samples, 2)} is needed: y − ŷ and its variance for each sample"
        )
    return found


def track_of(  # noqa: PLR0917
    scenario: Scenario, record: Record, estimated: Sequence[str], theta: Array, claimed: Any,
    innovations: Array | None, findings: Sequence[Any] | None,
) -> Track:  # fmt: skip
    """Return what is scored of estimates (N, p): the parameters whose true value has a size.

    Parameters
    ----------
    scenario : Scenario
    record : Record
        A simulated one.
    estimated : sequence of str
        Names of all p estimates.
    theta, claimed, innovations
        As from `follow`.
    findings : sequence or None
        What the estimator detected.
    """
    assert record.true_parameters is not None
    names = known_names(scenario, estimated)
    place, p = [list(estimated).index(name) for name in names], len(estimated)
    if len(place) < p and np.shape(claimed) == (p, p):
        claimed = np.asarray(claimed)[np.ix_(place, place)]
    return Track(
        scenario=scenario,
        names=names,
        theta=theta[:, place],
        true_parameters=record.true_parameters,
        torque=record.torque,
        claimed=claimed,
        innovations=innovations,
        findings=findings,
    )


def _done(unit: Unit, case: PlannedCase, found: Case, options: Options) -> Done:
    if options.trajectories is not None and found.theta is not None:
        times = np.arange(len(found.theta)) * unit.scenario.period
        path, about = options.trajectories / f"{case[0]}.nc", {"estimator": found.estimator}
        write_estimates(path, times, found.theta, found.names, about)
    trace = pack(found) if options.traces else None
    return _row(unit, case, found.rows, trace=trace)


def failure(unit: Unit, case: PlannedCase, error: str, record: Record | None = None) -> Done:
    """Return a case that failed: a run lost at its first sample.

    Without a record the run itself could not be simulated: one row without scores.
    """
    lines: Sequence[Mapping[str, Any]] = []
    if record is not None and record.true_parameters is not None:
        drawn = unit.scenario.drawn(case[2])
        lines = rows(failed_track(drawn, record.true_parameters, record.torque))
    return _row(unit, case, lines or [undefined()], error=error)


def _row(
    unit: Unit, case: PlannedCase, lines: Sequence[Mapping[str, Any]], *,
    error: str | None = None, trace: bytes | None = None,
) -> Done:  # fmt: skip
    (name, setting, seed), scenario = case, unit.scenario
    about = {
        "scenario": unit.base,
        "estimator": setting.estimator,
        "setting": setting.text,
        "code": setting.spec.digest,
        "hash": scenario.hash,
        "seconds": scenario.duration,
        "axes": {**unit.axes, **setting.axes},
        "parameters": [line["parameter"] or "" for line in lines],
    }
    numbers = np.array([[_number(line, column) for column in NUMBERS] for line in lines])
    if scenario.onset_spread is not None:
        onset = first_onset(scenario.drawn(seed)) * scenario.period
        numbers[:, NUMBERS.index("onset")] = onset
    named = lines[0].get("isolation")
    isolation = None if named is None else json.dumps(named)
    text = json.dumps(about, ensure_ascii=False)
    return Done(name, text, seed, numbers, isolation, error, platform.node(), trace)


def _number(line: Mapping[str, Any], name: str) -> float:
    table, _, part = name.partition(".")
    value = (line.get(table) or {}).get(part) if part else line.get(name)
    return np.nan if value is None else float(value)


def _note_not_finite(outcome: Outcome, spec: Spec, unit: Unit, seed: int, found: Case) -> None:
    if spec.is_users and found.theta is not None:
        finite = np.isfinite(found.theta).all(axis=1)
        if not finite.all():
            where = f"on {unit.scenario.name}, seed {seed}, sample {int(np.argmin(finite))}"
            outcome.remarks.append((spec.text, where))


def pack(case: Case) -> bytes:
    """Return what the figures of a case need, as the bytes of an .npz file."""
    about = [case.estimator, case.names, list(case.relative), list(case.detail.findings)]
    arrays: dict[str, Any] = {f"of {name}": values for name, values in case.relative.items()}
    arrays |= {"curve": case.curve, "near": case.detail.near}
    if case.detail.residual is not None:
        arrays["residual"] = case.detail.residual
    buffer = io.BytesIO()
    np.savez(buffer, about=np.array(json.dumps(about)), **arrays)
    return buffer.getvalue()


def unpack(content: bytes) -> Case:
    """Return the case that `pack` was given, without rows."""
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        estimator, names, changed, findings = json.loads(str(stored["about"]))
        detail = Detail(stored["near"], stored.get("residual"), tuple(findings))
        relative = {name: stored[f"of {name}"] for name in changed}
        return Case(estimator, tuple(names), stored["curve"], relative, detail)
