"""A pool of processes that leaves nothing behind."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from multiprocessing.util import Finalize
from typing import Any, Self

import numpy as np

from flexaxis.experiments.running import stopping
from flexaxis.experiments.running.interrupts import threads_left
from flexaxis.sim.current_folder import forget_safe_path, safe_path, without_its_style
from flexaxis.sim.errors import FlexaxisError

MOST = max(64, 4 * (os.cpu_count() or 1))  # processes: each is a Python of its own in memory


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


def _start_worker(stop: Any) -> None:
    """Leave Ctrl-C to the parent, and end when it ends: a killed parent leaves no process."""
    forget_safe_path()
    without_its_style()
    for kind in (signal.SIGINT, signal.SIGTERM):  # a queue of jobs sends that to all
        signal.signal(kind, signal.SIG_IGN)
    if hasattr(os, "setpgid"):
        os.setpgid(0, 0)  # so that what it starts can be killed with it
    stopping.begin(stop)
    parent = multiprocessing.parent_process()
    assert parent is not None
    threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()
    Finalize(None, _wait_for_no_thread, exitpriority=-1)  # after what others do at their end


def _wait_for_no_thread() -> None:
    """End a process that is done, though a thread of a user's code goes on."""
    if threads_left():
        os._exit(0)


def _end_with(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


class Pool(ProcessPoolExecutor):
    """Processes that can be asked to end what they are doing, and give back what is done."""

    def __init__(self, jobs: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._stop = context.Event()
        super().__init__(
            jobs, mp_context=context, initializer=_start_worker, initargs=(self._stop,)
        )

    def ask(self) -> None:
        """Ask them."""
        self._stop.set()


@contextmanager
def process_pool(jobs: int) -> Iterator[Pool]:
    """Give a pool of processes with one BLAS thread each, which end with this process.

    They are killed where the block is left by an error or by Ctrl-C.
    """
    single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    before = {key: os.environ.get(key) for key in single}
    os.environ.update(single)  # read by the children when they import NumPy
    with safe_path():  # its locks have a process of their own
        pool = Pool(jobs)
    try:
        yield pool
    except BaseException:  # nobody waits for what they do any more
        kill(pool)
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        for key, value in before.items():
            if value is None:
                os.environ.pop(key, None)
            else:
                os.environ[key] = value


class Workers:
    """A pool of processes that is lent again and again, for to start one takes seconds.

    A context manager. The processes start when they are first lent; those of a pool that is left by
    an error, by Ctrl-C or by a process that was lost end with it, and the next are new.

    Parameters
    ----------
    jobs : int
        Processes.
    """

    def __init__(self, jobs: int) -> None:
        self._jobs, self._stack = jobs, ExitStack()
        self._pool: Pool | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *rest: object) -> None:
        self._end(lost=kind is not None)

    @contextmanager
    def lent(self) -> Iterator[Pool]:
        """Give the pool as `process_pool` does, but for its end."""
        if self._pool is None:
            self._pool = self._stack.enter_context(process_pool(self._jobs))
        whole = False
        try:
            yield self._pool
            whole = not getattr(self._pool, "_broken", False)
        finally:
            if not whole:
                self._end(lost=True)

    def _end(self, *, lost: bool) -> None:
        pool, self._pool = self._pool, None
        if pool is not None and lost:  # nobody waits for what they do any more
            kill(pool)
        self._stack.close()


def kill(pool: Executor) -> None:
    """Kill the processes of a pool, and the programs that they have started."""
    for process in _workers(pool):
        if hasattr(os, "killpg") and process.pid is not None:
            with suppress(ProcessLookupError):  # it has ended, or has only just begun
                os.killpg(process.pid, signal.SIGKILL)
        process.kill()


def _workers(pool: Executor) -> Iterable[BaseProcess]:
    return list((getattr(pool, "_processes", None) or {}).values())
