"""Units of work to processes or to any executor, a bounded number at a time, and again if lost."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)

from flexaxis.experiments.running.plan import Unit
from flexaxis.experiments.running.processes import process_pool
from flexaxis.experiments.running.work import Outcome
from flexaxis.experiments.studies.definition import StudyError

ATTEMPTS = 3
Worker = Callable[[Unit], Outcome]


def spread(
    units: Iterable[Unit],
    work: Worker,
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    in_flight: int | None = None,
) -> Iterator[Outcome]:
    """Yield outcomes as they come, in any order.

    Parameters
    ----------
    units : iterable of Unit
        Drawn from as there is room, so that a study of any size needs no more memory.
    work : callable
        From unit to outcome; must travel by pickle.
    jobs : int
        Processes of our own; one stays in this process.
    executor : concurrent.futures.Executor, optional
        Where to work instead.
    in_flight : int, optional
        Units handed out at a time; twice the jobs by default.

    Raises
    ------
    StudyError
        If the worker of a unit dies or fails three times: names the unit.
    """
    room = in_flight or 2 * jobs
    if executor is not None:
        yield from _Flight(executor, work).all(units, room)
    elif jobs == 1:
        yield from map(work, units)
    else:
        yield from _own_pools(iter(units), work, jobs, room)


def _own_pools(units: Iterator[Unit], work: Worker, jobs: int, room: int) -> Iterator[Outcome]:
    """Start a new pool where a process was killed, which takes its whole pool with it.

    What was lost is run one by one, for only then it is known which unit kills its worker.
    """
    more = True
    while more:
        with process_pool(jobs) as pool:
            flight = _Flight(pool, work)
            try:
                yield from flight.all(units, room)
                more = False
            except BrokenExecutor:
                pass
        yield from _one_by_one([unit for unit, _ in flight.out.values()], work)


def _one_by_one(units: list[Unit], work: Worker) -> Iterator[Outcome]:
    attempt = 0
    while units:
        with process_pool(1) as pool:
            try:
                while units:
                    outcome = pool.submit(work, units[0]).result()
                    del units[0]
                    attempt = 0
                    yield outcome
            except BrokenExecutor as error:
                attempt += 1
                if attempt == ATTEMPTS:
                    raise _given_up(units[0], error) from error


class _Flight:
    """Units that are out, and how often each was tried, by the futures of their outcomes."""

    def __init__(self, executor: Executor, work: Worker) -> None:
        self.executor, self.work = executor, work
        self.out: dict[Future[Outcome], tuple[Unit, int]] = {}

    def all(self, units: Iterable[Unit], room: int) -> Iterator[Outcome]:
        for unit in units:
            self._submit(unit, 1)
            while len(self.out) >= room:
                yield from self._land()
        while self.out:
            yield from self._land()

    def _submit(self, unit: Unit, attempt: int) -> None:
        try:
            self.out[self.executor.submit(self.work, unit)] = unit, attempt
        except BrokenExecutor:
            self.out[Future()] = unit, attempt  # lost with the others
            raise

    def _land(self) -> Iterator[Outcome]:
        ready, _ = wait(self.out, return_when=FIRST_COMPLETED)
        for future in ready:
            error = CancelledError() if future.cancelled() else future.exception()
            if isinstance(error, BrokenExecutor):
                raise error
            unit, attempt = self.out.pop(future)
            if error is None:
                yield future.result()
            elif attempt < ATTEMPTS:
                self._submit(unit, attempt + 1)
            else:
                raise _given_up(unit, error)


def _given_up(unit: Unit, error: BaseException) -> StudyError:
    return StudyError(
        f"given up after {ATTEMPTS} attempts on {unit}: {type(error).__name__}: {error}. "
        "A worker that dies is often one that runs out of memory"
    )
