"""Work to processes or to any executor: a bounded number at a time, and again if lost."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from contextlib import AbstractContextManager, suppress
from functools import partial
from typing import Generic, TypeVar

from flexaxis.experiments.building.inherited import held_back
from flexaxis.experiments.running.errors import StudyError
from flexaxis.experiments.running.interrupts import PATIENCE, Interrupts, two_stage
from flexaxis.experiments.running.processes import Workers, kill, process_pool, stop
from flexaxis.experiments.running.stopping import Stopped, check, stoppable
from flexaxis.sim.current_folder import safe_path

ATTEMPTS = 3
Task = TypeVar("Task")
Result = TypeVar("Result")


def spread(
    tasks: Iterable[Task],
    work: Callable[[Task], Result],
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    in_flight: int | None = None,
    workers: Workers | None = None,
) -> Generator[Result, None, None]:
    """Yield results as they come, in any order.

    Ctrl-C once starts nothing new and stops what is at work; what is done of it comes in, unless
    that takes too long. Twice ends at once. Either way a KeyboardInterrupt follows.

    Parameters
    ----------
    tasks : iterable
        Drawn from as there is room, so that a study of any size needs no more memory; each says
        in words what it is (`str`).
    work : callable
        From task to result; must travel by pickle.
    jobs : int
        Processes of our own; one stays in this process.
    executor : concurrent.futures.Executor, optional
        Where to work instead.
    in_flight : int, optional
        Tasks handed out at a time; twice the jobs by default.
    workers : Workers, optional
        Processes that are there already, in the place of as many new ones as there are jobs.

    Raises
    ------
    StudyError
        If the worker of a task dies or fails three times: names the task.
    KeyboardInterrupt
        After Ctrl-C.
    """
    room = in_flight or 2 * jobs
    with two_stage() as interrupts:
        remaining = interrupts.until(tasks)
        if executor is not None:
            yield from _elsewhere(_Flight(executor, work, interrupts), remaining, room)
        elif jobs == 1:
            yield from _here(remaining, work)
        else:
            lend = workers.lent if workers else partial(process_pool, jobs)
            yield from _own_pools(remaining, work, lend, room, interrupts)
        interrupts.tell()


def _done(work: Callable[[Task], Result], task: Task) -> Result:
    """Return what became of a task; work that cannot say how far it has come is lost by a stop."""
    with stoppable():
        check()
        return work(task)
    raise Stopped


def _here(tasks: Iterator[Task], work: Callable[[Task], Result]) -> Iterator[Result]:
    for task in tasks:
        try:
            result = _done(work, task)
        except Stopped:
            return
        yield result


def _elsewhere(flight: _Flight[Task, Result], tasks: Iterator[Task], room: int) -> Iterator[Result]:
    try:
        yield from flight.all(tasks, room)
    finally:
        for future in flight.out:  # none is left but after an error or Ctrl-C
            future.cancel()


def _own_pools(
    tasks: Iterator[Task],
    work: Callable[[Task], Result],
    lend: Callable[[], AbstractContextManager[Executor]],
    room: int,
    interrupts: Interrupts,
) -> Iterator[Result]:
    """Start a new pool where a process was killed, which takes its whole pool with it.

    What was lost is run one by one, for only then it is known which task kills its worker.
    """
    more = True
    while more:
        with lend() as pool:
            interrupts.stop = partial(stop, pool)
            flight = _Flight(pool, partial(_done, work), interrupts)
            try:
                yield from flight.all(tasks, room)
                more = False
                if interrupts.asked:  # what they do now, nobody waits for
                    kill(pool)
            except BrokenExecutor:
                pass
        lost = [task for task, _ in flight.out.values()]
        yield from _one_by_one(lost, work, interrupts)


def _one_by_one(
    tasks: list[Task], work: Callable[[Task], Result], interrupts: Interrupts
) -> Iterator[Result]:
    attempt = 0
    while tasks and not interrupts.asked:
        with process_pool(1) as pool:
            interrupts.stop = partial(stop, pool)
            flight = _Flight(pool, partial(_done, work), interrupts)
            try:
                while tasks and not interrupts.asked:
                    yield from flight.all(tasks[:1], 1)
                    del tasks[0]
                    attempt = 0
                if interrupts.asked:  # what they do now, nobody waits for
                    kill(pool)
            except BrokenExecutor as error:
                attempt += 1
                if attempt == ATTEMPTS:
                    raise _given_up(tasks[0], error) from error


class _Flight(Generic[Task, Result]):
    """Tasks that are out, and how often each was tried, by the futures of their results.

    They are given up where they do not come in soon after Ctrl-C.
    """

    def __init__(
        self, executor: Executor, work: Callable[[Task], Result], interrupts: Interrupts
    ) -> None:
        self.executor, self.work, self.interrupts = executor, work, interrupts
        self.out: dict[Future[Result], tuple[Task, int]] = {}
        self.given_up = False

    def all(self, tasks: Iterable[Task], room: int) -> Iterator[Result]:
        for task in tasks:
            self._submit(task, 1)
            while len(self.out) >= room and not self.given_up:
                yield from self._land()
        while self.out and not self.given_up:
            yield from self._land()

    def _submit(self, task: Task, attempt: int) -> None:
        try:
            with held_back(), safe_path():
                self.out[self.executor.submit(self.work, task)] = task, attempt
        except BrokenExecutor:
            self.out[Future()] = task, attempt  # lost with the others
            raise

    def _land(self) -> Iterator[Result]:
        ready, _ = wait(self.out, timeout=PATIENCE, return_when=FIRST_COMPLETED)
        if self.interrupts.asked:
            self._give_back()
        for future in ready:
            error = CancelledError() if future.cancelled() else future.exception()
            if isinstance(error, BrokenExecutor):
                raise error
            if future not in self.out:  # given back just now
                continue
            task, attempt = self.out.pop(future)
            if error is None:
                yield future.result()
            elif isinstance(error, Stopped) or self.interrupts.asked:  # as missing as it was
                continue
            elif attempt < ATTEMPTS:
                self._submit(task, attempt + 1)
            else:
                raise _given_up(task, error)
        self.given_up = self.interrupts.overdue

    def _give_back(self) -> None:
        """Take back what has not begun: it is as missing as what was never handed out."""
        for future in list(self.out):
            with suppress(BrokenExecutor):
                if future.cancel():
                    del self.out[future]


def _given_up(task: object, error: BaseException) -> StudyError:
    why = f"{type(error).__name__}: {error}"
    if isinstance(error, BrokenExecutor):
        why = "a worker process died: its code ended it, memory ran out, or it was killed"
    return StudyError(f"given up after {ATTEMPTS} attempts on {task}: {why}")
