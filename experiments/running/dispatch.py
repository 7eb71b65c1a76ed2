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
from contextlib import AbstractContextManager, closing, suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, TypeVar

from flexaxis.experiments.building.programs import held_back
from flexaxis.experiments.running.errors import NotRun, StudyError
from flexaxis.experiments.running.interrupts import Interrupts, two_stage
from flexaxis.experiments.running.processes import Workers, process_pool
from flexaxis.sim.current_folder import safe_path

ATTEMPTS = 3  # on an executor of somebody else
PATIENCE = 0.5  # s for which a wait may last before it looks whether anything was asked
Task = TypeVar("Task")
Result = TypeVar("Result")


def _died(task: Any) -> Any:
    raise NotRun(
        f"{task}: its process died twice: its code ended it, memory ran out, or it was killed"
    )


@dataclass(frozen=True)
class Lost(Generic[Task, Result]):
    """What becomes of a task whose process died.

    Attributes
    ----------
    parts : callable
        Gives the parts of a task, each of which is run alone.
    died : callable
        Gives the result of a part whose process died again, or raises something.
    """

    parts: Callable[[Task], Iterable[Task]] = lambda task: [task]
    died: Callable[[Task], Result] = _died


def spread(
    tasks: Iterable[Task],
    work: Callable[[Task], Result],
    *,
    jobs: int = 0,
    executor: Executor | None = None,
    in_flight: int | None = None,
    workers: Workers | None = None,
    lost: Lost[Task, Result] | None = None,
) -> Generator[Result, None, None]:
    """Yield results as they come, in any order.

    Ctrl-C once starts nothing new, and asks what is at work to end (`running.stopping`); what is
    done of it comes in. Twice ends at once. Either way a KeyboardInterrupt follows.

    Parameters
    ----------
    tasks : iterable
        Drawn from as there is room, so that a study of any size needs no more memory; each says
        in words what it is (`str`).
    work : callable
        From task to result; must travel by pickle.
    jobs : int
        Processes of our own; 0 stays in this process.
    executor : concurrent.futures.Executor, optional
        Where to work instead.
    in_flight : int, optional
        Tasks handed out at a time; twice the jobs by default.
    workers : Workers, optional
        Processes that are there already, in the place of as many new ones as there are jobs.
    lost : Lost, optional
        A process that dies takes all that were at work with it; those are run again, one by one.

    Raises
    ------
    NotRun
        If the process of a task dies twice.
    StudyError
        If a task fails three times elsewhere: names the task.
    KeyboardInterrupt
        After Ctrl-C.
    """
    room = in_flight or 2 * max(1, jobs)
    with two_stage() as interrupts:
        remaining = interrupts.until(tasks)
        if executor is not None:
            with closing(_Flight(executor, work, interrupts, ATTEMPTS)) as flight:
                yield from flight.all(remaining, room)
        elif not jobs:
            yield from map(work, remaining)
        else:
            lend = workers.lent if workers else partial(process_pool, jobs)
            yield from _own(remaining, work, lend, room, interrupts, lost or Lost())
        interrupts.tell()


def _own(  # noqa: PLR0917
    tasks: Iterator[Task],
    work: Callable[[Task], Result],
    lend: Callable[[], AbstractContextManager[Any]],
    room: int,
    interrupts: Interrupts,
    lost: Lost[Task, Result],
) -> Iterator[Result]:
    """Start a new pool where a process died, after what was out with it was run one by one."""
    more = True
    while more:
        with lend() as pool:
            interrupts.stop = getattr(pool, "ask", interrupts.stop)
            flight = _Flight(pool, work, interrupts)
            with suppress(BrokenExecutor):
                yield from flight.all(tasks, room)
                more = False
        out = [part for task, _ in flight.out.values() for part in lost.parts(task)]
        yield from _alone(out, work, interrupts, lost)


def _alone(
    tasks: list[Task],
    work: Callable[[Task], Result],
    interrupts: Interrupts,
    lost: Lost[Task, Result],
) -> Iterator[Result]:
    died = 0
    while tasks and not interrupts.asked:
        with process_pool(1) as pool:
            interrupts.stop = pool.ask
            try:
                while tasks and not interrupts.asked:
                    yield from _Flight(pool, work, interrupts).all(tasks[:1], 1)
                    del tasks[0]
                    died = 0
            except BrokenExecutor:
                died += 1
        if died == 2:
            yield lost.died(tasks.pop(0))
            died = 0


class _Flight(Generic[Task, Result]):
    """Tasks that are out, and how often each was tried, by the futures of their results."""

    def __init__(
        self,
        executor: Executor,
        work: Callable[[Task], Result],
        interrupts: Interrupts,
        attempts: int = 1,
    ) -> None:
        self.executor, self.work, self.interrupts = executor, work, interrupts
        self.attempts = attempts
        self.out: dict[Future[Result], tuple[Task, int]] = {}

    def close(self) -> None:
        """Take back what has not begun."""
        for future in list(self.out):
            with suppress(BrokenExecutor):
                if future.cancel():
                    del self.out[future]

    def all(self, tasks: Iterable[Task], room: int) -> Iterator[Result]:
        """Yield the results of tasks, of which so many are out at a time."""
        for task in tasks:
            self._submit(task, 1)
            while len(self.out) >= room:
                yield from self._land()
        while self.out:
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
            self.close()
        for future in ready:
            error = CancelledError() if future.cancelled() else future.exception()
            if isinstance(error, BrokenExecutor):
                raise error
            if future not in self.out:  # taken back just now
                continue
            task, attempt = self.out.pop(future)
            if error is None:
                yield future.result()
            elif self.interrupts.asked:  # as missing as it was
                continue
            elif attempt < self.attempts:
                self._submit(task, attempt + 1)
            elif self.attempts == 1:
                raise error
            else:
                why = f"{type(error).__name__}: {error}"
                raise StudyError(f"given up after {attempt} attempts on {task}: {why}") from error
