"""Run cases: get each record once, give it to every estimator, score the estimates.

A case is one estimator on one record. Cases are grouped into tasks, a scenario and some seeds
each, that go to a pool of processes; the results do not depend on how they are grouped, and come
back in the order of scenario, seed, estimator.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.running.cache import RecordCache, records
from flexaxis.experiments.running.crashes import crash
from flexaxis.experiments.running.processes import process_pool
from flexaxis.experiments.running.specs import Spec, build, parse, parse_all
from flexaxis.experiments.scoring.case import Track
from flexaxis.experiments.scoring.pooling import Case, scored
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario

SEEDS_PER_TASK = 16  # enough to share the cost of a batch, few enough to see progress


@dataclass(frozen=True)
class Task:
    """A scenario, some of its seeds, the estimators that get the records, and where these lie.

    `repeat` as in `simulate`: 0, or the number of another noise on the same runs.
    """

    scenario: Scenario
    estimators: tuple[str, ...]
    seeds: tuple[int, ...]
    store: RecordCache | None = None
    repeat: int = 0


@dataclass(frozen=True)
class Done:
    """The cases of a task, and how many records had to be simulated for them."""

    cases: list[Case]
    simulated: int


def run(
    scenarios: Sequence[Scenario],
    estimators: Sequence[str],
    seeds: Sequence[int],
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    store: RecordCache | None = None,
    repeat: int = 0,
) -> Iterator[Done]:
    """Run every estimator on every record, and give the cases of each task, in order.

    The call itself checks that every estimator can be built; the cases are computed as they are
    asked for.

    Parameters
    ----------
    scenarios : sequence of Scenario
    estimators : sequence of str
        Texts as for `--estimator`.
    seeds : sequence of int
    jobs : int
        Processes. One stays in this process.
    executor : concurrent.futures.Executor, optional
        Where to run the tasks instead of a pool of our own.
    store : RecordCache, optional
        Where records are kept; without one every record is simulated.
    repeat : int
        As in `simulate`: 0, or the number of another noise on the same runs.

    Raises
    ------
    EstimatorError
        If an estimator cannot be built, at once; or when it raises on a record.
    SimulationError
        If a simulation fails. What came before stays valid.
    """
    names = tuple(dict.fromkeys(estimators))
    for spec in parse_all(names):
        for scenario in scenarios:
            build(spec, scenario)  # wrong options are found before anything is computed
    planned = tasks(scenarios, names, seeds, jobs=jobs)
    todo = [replace(task, store=store, repeat=repeat) for task in planned]
    return _spread(todo, jobs, executor)


def _spread(todo: list[Task], jobs: int, executor: Executor | None) -> Iterator[Done]:
    if executor is not None:
        yield from executor.map(run_task, todo)
    elif jobs == 1 or len(todo) == 1:
        yield from map(run_task, todo)
    else:
        with process_pool(min(jobs, len(todo))) as pool:
            yield from pool.map(run_task, todo)


def tasks(
    scenarios: Sequence[Scenario],
    estimators: tuple[str, ...],
    seeds: Sequence[int],
    *,
    jobs: int = 1,
) -> Iterator[Task]:
    """Yield the tasks of a run, at least one for each process where there are seeds enough."""
    size = max(1, min(SEEDS_PER_TASK, -(-len(seeds) // jobs)))
    for scenario in scenarios:
        for first in range(0, len(seeds), size):
            yield Task(scenario, estimators, tuple(seeds[first : first + size]))


def run_task(task: Task) -> Done:
    """Get the records of a task and run its estimators on each."""
    specs = [parse(text) for text in task.estimators]
    for spec in specs:
        warm(spec, task.scenario)
    found, simulated = records(task.scenario, task.seeds, task.store, repeat=task.repeat)
    cases = [run_case(task.scenario, record, spec) for record in found for spec in specs]
    return Done(cases, simulated)


def warm(spec: Spec, scenario: Scenario) -> None:
    """Let an estimator compile what it compiles, so that the cost scored is that of running."""
    rest = np.zeros(2)
    _estimates(spec, build(spec, scenario), rest, rest, None, where=f"{scenario.name} (warm-up)")


def case_id(scenario_hash: str, estimator: str, seed: int | None) -> str:
    """Return the identity of a case: 64 bits in hexadecimal."""
    return sha256(f"{scenario_hash} {estimator} {seed}".encode()).hexdigest()[:16]


def run_case(scenario: Scenario, record: Record, spec: Spec, *, whole: bool = False) -> Case:
    """Run an estimator on a record and score it; `whole` keeps all estimates.

    Raises
    ------
    EstimatorError
        If the estimator raises, or returns what it may not.
    """
    assert record.true_parameters is not None  # a simulated record knows the truth
    estimator = build(spec, scenario)
    start = time.perf_counter()
    where = f"{scenario.name}, seed {record.seed}"
    theta, claimed = _with_claim(spec, estimator, scenario, record, where=where)
    seconds = time.perf_counter() - start
    track = Track(
        scenario=scenario,
        names=tuple(estimator.names),
        theta=theta,
        true_parameters=record.true_parameters,
        torque=record.torque,
        claimed=claimed,
        findings=getattr(estimator, "findings", None),
    )
    identity = {
        "case": case_id(scenario.hash, spec.text, record.seed),
        "hash": scenario.hash,
        "scenario": scenario.name,
        "estimator": spec.text,
        "seed": record.seed,
    }
    cost = {
        "us_per_sample": 1e6 * seconds / len(theta),
        "seconds": seconds,
        "host": platform.node(),
    }
    seed = record.seed or 0
    return scored(track, estimator=spec.text, seed=seed, identity=identity, cost=cost, whole=whole)


def _with_claim(
    spec: Spec, estimator: Any, scenario: Scenario, record: Record, *, where: str
) -> tuple[NDArray[np.float64], Any]:
    """Return the estimates, and the covariance claimed at the first fault, or at the end."""
    events = scenario.events()
    stop = events[0].index if events and hasattr(estimator, "covariance") else scenario.samples
    y = getattr(record, scenario.output)
    valid = record.valid
    parts = []
    claimed = None
    for part in (slice(0, stop), slice(stop, None)):
        if part.start < scenario.samples:
            gaps = None if valid is None else valid[part]
            u = record.torque[part]
            parts.append(_estimates(spec, estimator, u, y[part], gaps, where=where))
        if claimed is None:
            claimed = getattr(estimator, "covariance", None)
    return np.concatenate(parts), claimed


def _estimates(
    spec: Spec, estimator: Any, u: Any, y: Any, valid: Any, *, where: str
) -> NDArray[np.float64]:
    """Run an estimator; what a user's code raises is said with its name and the record's."""
    try:
        theta = run_estimator(estimator, u, y, valid)
    except Exception as error:
        raise crash(spec.text, f"on {where}", error) from error
    if theta.shape != (len(u), len(estimator.names)):
        raise EstimatorError(
            f"{spec.text} returned estimates of the shape {theta.shape} on {where}; "
            f"{(len(u), len(estimator.names))} is needed: one row a sample, one column a name"
        )
    return theta
