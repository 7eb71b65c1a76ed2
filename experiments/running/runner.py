"""Execute the missing runs of a study on worker processes or on another executor."""

import os
import signal
import threading
import time
import weakref
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any, Self

import numpy as np
import pandas as pd
from loky import ProcessPoolExecutor

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.compiler import is_uncompiled
from flexaxis.experiments.files import NotRun, StudyError
from flexaxis.experiments.running.cache import RecordCache
from flexaxis.experiments.running.case import Done, Options, Outcome, run_unit, simulate_units
from flexaxis.experiments.running.estimators import Misfit, Spec, build, parse
from flexaxis.experiments.running.progress import progress
from flexaxis.experiments.running.results import Results
from flexaxis.experiments.running.store import CSV, Store
from flexaxis.experiments.running.study import UNITS, Study, Unit, describe, missing, units
from flexaxis.experiments.running.user_code import (
    TIME_LIMIT,
    EstimatorCrash,
    ended_after,
    why_it_ended,
)
from flexaxis.experiments.scoring.summary import NUMBERS
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario

Pair = tuple[Scenario, Spec]
ENVIRONMENT = {"PYTHONSAFEPATH": "1"} | dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
"""Environment variables of a worker process. PYTHONSAFEPATH prevents Python from importing modules
from the current folder, so that no file in this folder can replace a library. The other variables
limit the worker to one thread."""


class Worker:
    """A worker process that runs one unit at a time; each worker can be terminated on its own."""

    def __init__(self) -> None:
        self._pool = _pool()

    def submit(self, work: Callable[..., Any], *args: Any) -> Future[Any]:
        """Submit work to the worker process, and start the process if necessary."""
        try:
            return self._pool.submit(work, *args)  # type: ignore[no-any-return]
        except BrokenExecutor:  # the idle process was killed
            self.end()
            return self._pool.submit(work, *args)  # type: ignore[no-any-return]

    def end(self) -> None:
        """Terminate the worker process and its child processes."""
        self._pool.shutdown(wait=True, kill_workers=True)
        self._pool = _pool()


def _pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, initializer=_start, initargs=(os.getpid(),), env=ENVIRONMENT)


def _start(parent: int) -> None:
    """Make the worker ignore Ctrl-C, redirect stdout to stderr, and exit if the parent exits."""
    for kind in (signal.SIGINT, signal.SIGTERM):
        signal.signal(kind, signal.SIG_IGN)
    os.dup2(2, 1)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(1)
    os._exit(1)


class Runner:
    """Context manager that runs studies on a set of worker processes and stores the scores.

    Parameters
    ----------
    folder : Path, optional
        Folder in which the scores are stored. Runs whose scores are already in the folder are not
        repeated. Without a folder, the scores are kept in memory.
    jobs : int
        Number of worker processes.
    executor : concurrent.futures.Executor, optional
        Executor to use instead of worker processes, such as the executor of a Dask client.
    cache : RecordCache, optional
        Cache of simulated records. Without a cache, every record is simulated again.
    time_limit : float
        Time limit for one run of a user's estimator [s].
    overwrite : bool
        Whether to remove existing scores from the folder before the first run.
    shard : (int, int)
        Number of the shard to run, counted from 1, and total number of shards.

    Raises
    ------
    StudyError
        If another version of the code computed the scores in the folder.
    FlexaxisError
        If the number of jobs or the time limit is invalid.
    """

    def __init__(
        self, folder: Path | None = None, *, jobs: int = 1, executor: Executor | None = None,
        cache: RecordCache | None = None, time_limit: float | None = None,
        overwrite: bool = False, shard: tuple[int, int] = (1, 1),
    ) -> None:  # fmt: skip
        limit = TIME_LIMIT if time_limit is None else time_limit
        if not (jobs >= 1 and 0 < limit < float("inf")):
            raise FlexaxisError(
                f"--jobs {jobs}, --time-limit {limit}: both must be positive, and the time limit "
                "must be finite (in Python: jobs=, time_limit=)"
            )
        self._logs = mkdtemp(prefix="flexaxis-")
        weakref.finalize(self, rmtree, self._logs, ignore_errors=True)
        self._options = Options(cache, time_limit=limit)
        self._workers: Sequence[Any] = (
            [executor] * 2 * jobs if executor else [Worker() for _ in range(jobs)]
        )
        self._folder, self._overwrite, self.shard = folder, overwrite, shard

    @cached_property
    def store(self) -> Store:
        """Store of the scores.

        The first access creates the folder and, with `overwrite`, removes old scores.
        """
        store = Store(self._folder, overwrite=self._overwrite)
        store.check()
        return store

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        for worker in self._workers:
            if isinstance(worker, Worker):
                worker.end()

    def run(
        self, study: Study, *, traces: bool = False,
        about: Mapping[str, Any] | None = None,
    ) -> Results:  # fmt: skip
        """Execute all runs of a study that have no results yet, and return the results.

        Parameters
        ----------
        study : Study
            Study to run.
        traces : bool
            Whether to store the estimates as functions of time, for figures of single runs. If
            `traces` is true, stored runs without such estimates are repeated.
        about : mapping, optional
            Properties to add to the description of the study. If `about` is given, this description
            replaces the description that is stored in the folder.

        Raises
        ------
        StudyError, EstimatorError
            If the study is invalid, or if an estimator cannot be constructed.
        NotRun
            If the computer could not execute some runs. The results of finished runs are kept.
        KeyboardInterrupt
            After Ctrl-C. The results of finished runs are kept. A second call of `run` executes the
            missing runs.
        """
        plan = units(study)
        part = plan[self.shard[0] - 1 :: self.shard[1]]
        pairs = [pair for pair in _pairs(part) if pair[1].options or pair[1].is_users]
        for error in self._problems(pairs).values():  # fail before the first run
            raise error
        todo = list(missing(part, self.store.done(traced=traces)))
        description = describe(study, plan) | dict(about or {})
        if about is not None:
            self.store.tell(study=description)
        lost, reason = sum(len(unit.cases()) for unit in todo), "unknown reason"
        with progress(f"{lost} cases", lost) as advance:
            for outcome in self._outcomes(todo, replace(self._options, traces=traces)):
                cases = [case for case in outcome if isinstance(case, Done)]
                self.store.add(cases)
                lost -= len(cases)
                reason = next((case for case in outcome if isinstance(case, str)), reason)
                advance(len(cases))
        if lost:
            raise NotRun(
                f"{lost} runs are missing: {reason}. The results of finished runs are kept. To "
                "execute the missing runs, repeat the command"
            )
        results = Results(self.store, description)
        if about is not None and self.store.folder:
            results.to_csv(self.store.folder / CSV)
        return results

    def rows(
        self, scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int], *,
        traces: bool = False,
    ) -> pd.DataFrame:  # fmt: skip
        """Execute all runs that have no results yet, and return the scores of all runs."""
        study = Study("cases", tuple(scenarios), tuple(estimators), tuple(seeds))
        return self.run(study, traces=traces).frame

    def _outcomes(self, todo: Iterable[Unit], options: Options) -> Iterator[Outcome]:
        """Yield the outcome of each unit of work as soon as the unit is finished."""
        queue, free = deque(todo), list(self._workers)
        self._compile([*queue][:UNITS], options)
        running: dict[Future[Outcome], tuple[Any, Unit, str]] = {}
        while running or queue:
            while queue and free:
                worker, unit = free.pop(), queue.popleft()
                log = f"{self._logs}/{id(worker)}" if isinstance(worker, Worker) else os.devnull
                future = worker.submit(run_unit, unit, replace(options, log=log))
                running[future] = worker, unit, log
            # The timeout allows Ctrl-C to interrupt.
            done, _ = wait(running, timeout=0.5, return_when=FIRST_COMPLETED)
            for future in done:
                worker, unit, log = running.pop(future)
                free.append(worker)
                if (error := future.exception()) is None:
                    yield future.result()
                else:
                    yield self._after_death(worker, unit, log, error, queue)

    def _compile(self, todo: Sequence[Unit], options: Options) -> None:
        """Compile the uncompiled filters on one worker while the other workers simulate records.

        The compiling worker starts with the filter of the last estimator. When the other workers
        have simulated the records, they compile the remaining filters, starting with the filter of
        the first estimator.
        """
        first, *others = self._workers
        if others and options.cache and isinstance(first, Worker) and is_uncompiled():
            pairs = [pair for pair in _pairs(todo) if not pair[1].is_users]
            first.submit(_problems, pairs[::-1], options)
            for i, worker in enumerate(others):
                worker.submit(simulate_units, todo[i :: len(others)], options)

    def _after_death(
        self, worker: Any, unit: Unit, log: str, error: BaseException, queue: deque[Unit]
    ) -> Outcome:
        """After a worker process has died, queue each run of its unit separately.

        If the unit contains a single run of a user-written estimator, the run is marked as failed.
        If the unit contains a single run of a registered estimator, the method returns the reason
        why the worker died.
        """
        if not isinstance(error, BrokenExecutor) and type(error).__name__ != "KilledWorker":
            raise StudyError(
                f"{unit.scenario.name}, seeds {unit.seeds}: {type(error).__name__}: {error}"
            ) from error
        if isinstance(worker, Worker):
            worker.end()
        reason, cases = why_it_ended(log, self._options.time_limit), unit.cases()
        _, setting, seed = cases[0]
        if len(cases) > 1:
            alone = [replace(unit, settings=(each,), seeds=(k,)) for _, each, k in cases]
            queue.extendleft(alone[::-1])
        elif setting.spec.is_users:
            text = f"EstimatorCrash: {setting.text} crashed on {unit.scenario.name}, seed {seed}: "
            queue.appendleft(replace(unit, error=text + reason))
        else:  # out of memory, or the process was killed
            return [f"{unit.scenario.name}, seed {seed}: {reason}"]
        return []

    def misfits(self, scenarios: Sequence[Scenario], texts: Sequence[str]) -> dict[str, str]:
        """Return the reasons why estimators cannot run on scenarios, keyed by scenario name."""
        problems = self._problems([(each, parse(text)) for each in scenarios for text in texts])
        return {name: str(e) for name, e in problems.items() if isinstance(e, Misfit)}

    def _problems(self, pairs: Sequence[Pair]) -> Mapping[str, EstimatorError]:
        """Return the errors of estimators that cannot be constructed, keyed by scenario name."""
        with suppress(BrokenExecutor):  # the runs will show which estimator ends the process
            if pairs:
                work = self._workers[0].submit(_problems, pairs, self._options)
                return work.result()  # type: ignore[no-any-return]
        return {}


def _pairs(todo: Iterable[Unit]) -> list[Pair]:
    """Return one pair (scenario, estimator specification) for each estimator setting."""
    pairs = {each.text: (unit.scenario, each.spec) for unit in todo for each in unit.settings}
    return list(pairs.values())


def _problems(pairs: Sequence[Pair], options: Options) -> dict[str, EstimatorError]:
    problems = {}
    for scenario, spec in pairs:
        try:
            with ended_after(options.time_limit, options.log):
                build(spec, scenario)
        except EstimatorError as error:
            problems[scenario.name] = error
    return problems


def rerun(results: Results, runner: Runner, sample: int = 0) -> pd.DataFrame:
    """Repeat stored runs with the installed flexaxis version, and compare the old and new scores.

    Parameters
    ----------
    results : Results
        Stored results. The function does not change the folder of `results`.
    runner : Runner
        Runner that does not use the folder of `results`.
    sample : int
        Approximate number of runs to repeat. The repeated runs are evenly spaced in the list of
        runs. If `sample` is 0, all runs are repeated.

    Returns
    -------
    DataFrame
        Table with the columns ``scenario, estimator, seed, parameter, score, difference``. The
        column ``score`` contains the name of the score that differs most. The column ``difference``
        contains the relative difference between the old and the new value of this score. The
        difference is infinite if only one of the two values is defined.
    """
    scores, key = [name for name in NUMBERS if "cost." not in name], ["seed", "parameter"]
    cases, lines = results.frame["case"].unique(), []
    if not len(cases):
        raise StudyError(f"{results.folder} contains no finished cases. Run the study first")
    chosen = cases[:: max(1, len(cases) // (sample or len(cases)))]
    stored = results.frame[results.frame["case"].isin(chosen)]
    for (_, setting), own in stored.groupby(["hash", "setting"], sort=False):
        scenario = results.scenario(own.iloc[0])
        again = runner.rows([scenario], [setting], own["seed"].unique().tolist())
        old, new = (rows.set_index(key)[scores].astype(float) for rows in (own, again))
        new = new.reindex(old.index)
        share = (old - new).abs() / np.maximum(old.abs(), new.abs())
        share = share.mask((old == new) | (old.isna() & new.isna()), 0.0).fillna(np.inf)
        worst = {"score": share.idxmax(axis=1), "difference": share.max(axis=1)}
        lines.append(own[["scenario", "estimator", *key]].join(pd.DataFrame(worst), on=key))
    return pd.concat(lines)


def check_failures(frame: pd.DataFrame) -> None:
    """If any run failed, raise an `EstimatorCrash` with the message of the first failed run."""
    for error in frame["error"].dropna():
        raise EstimatorCrash(error.partition(": ")[2])
