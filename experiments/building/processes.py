"""Work to processes of our own or to any executor: a bounded number of tasks at a time."""

from __future__ import annotations

import atexit
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from itertools import islice
from types import ModuleType
from typing import Any, Self, TypeVar
from weakref import WeakSet

import numpy as np

from flexaxis.experiments.building import worker
from flexaxis.experiments.building.interrupts import Interrupts, two_stage
from flexaxis.experiments.building.pipe import held_back
from flexaxis.experiments.storage.files import NotRun, StudyError
from flexaxis.sim.errors import FlexaxisError

MOST = max(64, 4 * (os.cpu_count() or 1))  # processes: each is a Python of its own in memory
SAFE_PATH = worker.SAFE_PATH
PATIENCE = 0.5  # s for which a wait may last before it looks whether anything was asked
Task = TypeVar("Task")
Result = TypeVar("Result")


def check_jobs(jobs: Any, *, what: str = "jobs") -> None:
    """Refuse a number of processes that is none; `what` stands before it in the message.

    Raises
    ------
    FlexaxisError
    """
    if isinstance(jobs, bool | np.bool_) or not isinstance(jobs, int | np.integer) or jobs < 1:
        raise FlexaxisError(f"{what} {jobs!r}: give the number of processes, 1 or more")
    if jobs > MOST:
        raise FlexaxisError(f"{what} {str(jobs)[:40]}: give at most {MOST} processes")


class Workers:
    """Processes that one call after the other uses, for to start one takes seconds.

    A context manager. They start when they are first asked for something, end with this process,
    and are killed where the block is left by an error or by Ctrl-C.

    Parameters
    ----------
    jobs : int
        Processes.
    begin : callable, optional
        Called in each of them before anything else.
    """

    def __init__(self, jobs: int, begin: Callable[[], object] | None = None) -> None:
        self._jobs, self._begin, self._stop = jobs, begin, threading.Event()
        self._pool: Executor | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *rest: object) -> None:
        busy = getattr(self._pool, "_pending_work_items", True)  # else they end by themselves
        self.end(killed=kind is not None and bool(busy))

    def submit(self, work: Callable[[Task], Result], task: Task) -> Future[Result]:
        """Have a task done.

        Raises
        ------
        BrokenExecutor
            If one of the processes has died.
        """
        begun = len(getattr(self._pool, "_processes", None) or ())
        alone = _without_main() if begun < self._jobs else nullcontext()
        with held_back(), _safe_path(), alone:
            if self._pool is None:
                self._pool, self._stop = _started(self._jobs, self._begin)
                _open.add(self)
            if getattr(self._pool, "_broken", False):  # it may wait for the others to end
                raise BrokenExecutor("a process has died")
            # Once more: its locks have a process of their own, and who starts that (in Python 3.11
            # and the first of 3.12 and 3.13) lets Ctrl-C through to a worker that begins.
            with held_back():
                future: Future[Result] = self._pool.submit(work, task)
            return future

    def ask(self) -> None:
        """Ask them to end what they are doing, and to give back what is done."""
        self._stop.set()

    def end(self, *, killed: bool) -> None:
        """End them, with the programs that they have started; the next are new."""
        pool, self._pool = self._pool, None
        if pool is None:
            return
        killed |= bool(getattr(pool, "_broken", False))  # else it waits for the others for ever
        processes = [*(getattr(pool, "_processes", None) or {}).values()] if killed else []
        manager = getattr(pool, "_executor_manager_thread", None)
        if killed and sys.version_info < (3, 12):
            # Its thread ends in a traceback where it finds a process dead while a future that was
            # cancelled is on its list. Later ones do not, and wait here for who is not killed yet.
            pool.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            if hasattr(os, "killpg") and process.pid is not None:
                with suppress(OSError):  # it has ended, or has only just begun
                    os.killpg(process.pid, signal.SIGKILL)
            process.kill()
        pool.shutdown(wait=True, cancel_futures=True)
        if manager:
            manager.join()


_open = WeakSet[Workers]()


def _end_own() -> None:
    """End what this process has started; it would be waited for, and waits for work."""
    for workers in [*_open]:
        workers.end(killed=True)


def _started(jobs: int, begin: Callable[[], object] | None) -> tuple[Executor, Any]:
    """Return new processes, and what asks them to end."""
    atexit.unregister(_end_own)
    atexit.register(_end_own)  # before multiprocessing waits for them
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    tied = threading.current_thread() is threading.main_thread()
    how = (stop, begin, _end_own, tied)
    return ProcessPoolExecutor(jobs, context, initializer=worker.start, initargs=how), stop


@contextmanager
def _safe_path() -> Iterator[None]:
    """Let a worker that starts meanwhile find no modules in the current folder."""
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before


_mains: list[ModuleType] = []  # found by each `_without_main` that is open
_one_at_a_time = threading.Lock()


@contextmanager
def _without_main() -> Iterator[None]:
    """Have no process that is started meanwhile run the script that we are a part of."""
    with _one_at_a_time:
        _mains.append(sys.modules["__main__"])
        sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        with _one_at_a_time:
            found = _mains.pop()
            if not _mains:  # the last one to leave has what the first one found
                sys.modules["__main__"] = found


def spread(
    tasks: Iterable[Task],
    work: Callable[[Task], Result],
    *,
    jobs: int = 0,
    executor: Executor | None = None,
    in_flight: int | None = None,
    workers: Workers | None = None,
) -> Generator[Result, None, None]:
    """Yield results as they come, in any order.

    Ctrl-C once starts nothing new, and asks what is at work to end; what is done of it comes in.
    Twice ends at once. Either way a KeyboardInterrupt follows.

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

    Raises
    ------
    NotRun
        If the process of a task dies twice where it is run alone: a process that dies takes all
        that were at work with it, which are run again one by one.
    StudyError
        If a task fails elsewhere: names the task.
    KeyboardInterrupt
        After Ctrl-C.
    """
    room = in_flight or 2 * max(1, jobs)
    with two_stage() as asked:
        remaining = asked.until(tasks)
        if executor is not None:
            yield from _elsewhere(remaining, work, executor, room, asked)
        elif not jobs:
            yield from map(work, remaining)
        else:
            with nullcontext(workers) if workers else Workers(jobs) as own:
                yield from _own(remaining, work, own, room, asked)
        asked.tell()


def _elsewhere(
    tasks: Iterator[Task],
    work: Callable[[Task], Result],
    executor: Executor,
    room: int,
    asked: Interrupts,
) -> Iterator[Result]:
    out: dict[Future[Result], Task] = {}
    try:
        yield from _landed(lambda task: executor.submit(work, task), tasks, room, asked, out)
    except Exception as error:
        failed = [task for future, task in out.items() if future.done()]
        why = f"{failed[0] if failed else ''}: {type(error).__name__}: {error}"
        raise StudyError(f"given up on {why}") from error
    finally:
        for future in out:
            future.cancel()


def _own(
    tasks: Iterator[Task],
    work: Callable[[Task], Result],
    workers: Workers,
    room: int,
    asked: Interrupts,
) -> Iterator[Result]:
    """Start new processes where one died, after what was out with it was run one by one."""
    whole = False
    try:
        while not whole:
            asked.stop = workers.ask
            out: dict[Future[Result], Task] = {}
            try:
                yield from _landed(partial(workers.submit, work), tasks, room, asked, out)
                whole = True
            except BrokenExecutor:
                workers.end(killed=True)
                yield from _alone(list(out.values()), work, asked)
    finally:
        if not whole:  # nobody waits for what they do any more
            workers.end(killed=True)


def _alone(
    tasks: list[Task], work: Callable[[Task], Result], asked: Interrupts
) -> Iterator[Result]:
    with Workers(1) as one:
        asked.stop = one.ask
        for task in tasks:
            for _ in range(2):
                if asked.asked:
                    return
                try:
                    yield from _landed(partial(one.submit, work), iter([task]), 1, asked, {})
                    break
                except BrokenExecutor:
                    one.end(killed=True)
            else:
                raise NotRun(f"{task}: its process died twice: memory ran out, or it was killed")


def _landed(
    submit: Callable[[Task], Future[Result]],
    tasks: Iterator[Task],
    room: int,
    asked: Interrupts,
    out: dict[Future[Result], Task],
) -> Iterator[Result]:
    """Yield the results of tasks, of which so many are out at a time; `out` tells which."""
    while True:
        for task in islice(tasks, room - len(out)):
            try:
                future = submit(task)
            except BrokenExecutor:
                out[Future()] = task  # lost with the others
                raise
            out[future] = task
        if not out:
            return
        ready, _ = wait(out, timeout=PATIENCE, return_when=FIRST_COMPLETED)
        if asked.asked:
            for future in list(out):
                if future.cancel():
                    del out[future]
        for future in ready & out.keys():
            error = CancelledError() if future.cancelled() else future.exception()
            if error is None:
                del out[future]
                yield future.result()
            elif not asked.asked or isinstance(error, BrokenExecutor):
                raise error
            else:  # as missing as it was
                del out[future]
