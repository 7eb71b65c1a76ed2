"""Processes that are lent again and again: the same ones, until one of them is lost."""

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from pathlib import Path

import pytest

from flexaxis.experiments.building import processes
from flexaxis.experiments.building.processes import Workers, spread
from flexaxis.experiments.running.engine import Means


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_calls_share_a_pool_until_one_is_left(monkeypatch):
    pools = []

    def started(jobs, begin):
        pools.append(ThreadPoolExecutor(jobs))
        return pools[-1], threading.Event()

    monkeypatch.setattr(processes, "_started", started)
    with Workers(2) as workers:
        for _ in range(2):
            assert sorted(spread([-1, -2], abs, jobs=2, workers=workers)) == [1, 2]
        assert len(pools) == 1
        left = spread([1, 2, 3], abs, jobs=2, workers=workers)
        next(left)
        left.close()
        assert pools[0]._shutdown
        assert list(spread([4], abs, jobs=2, workers=workers)) == [4]
    assert len(pools) == 2 and pools[1]._shutdown


@pytest.mark.skipif(os.name == "nt", reason="signals differ on Windows")
def test_a_pool_of_which_an_idle_process_has_died_ends_and_takes_nothing():
    with ThreadPoolExecutor(1) as beside, Workers(2) as workers:
        for future in [workers.submit(time.sleep, 0.5) for _ in range(2)]:
            future.result()
        pool, pids = workers._pool, [*workers._pool._processes]
        os.kill(pids[0], signal.SIGKILL)
        while not pool._broken:
            time.sleep(0.01)
        with pytest.raises(BrokenExecutor):
            beside.submit(workers.submit, abs, -1).result(timeout=30)
        beside.submit(workers.end, killed=False).result(timeout=30)
        assert not any(map(alive, pids))


FIRST = """
import signal
from functools import partial
from flexaxis.experiments.building.processes import Workers
with Workers(2) as workers:
    for _ in range(2):
        held = workers.submit(partial(signal.pthread_sigmask, signal.SIG_BLOCK), ()).result()
        print(signal.SIGINT in held, signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()))
"""


@pytest.mark.skipif(os.name == "nt", reason="signals differ on Windows")
def test_a_process_hears_no_ctrl_c_from_its_first_moment_on():
    """In a Python that has started no other process: the first is started with that of locks."""
    words = [sys.executable, "-c", FIRST]
    told = subprocess.run(words, capture_output=True, text=True, check=True, timeout=100)
    assert told.stdout.split() == ["True", "False"] * 2


@pytest.mark.slow
def test_the_second_call_has_the_processes_of_the_first(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    from study_stubs import dies_if, which

    with Workers(1) as workers:
        (first,) = spread([0], which, jobs=2, workers=workers)
        (second,) = spread([0], which, jobs=2, workers=workers)
        assert first == second != os.getpid()
        # One that is lost is replaced, and what was out with it is run again elsewhere.
        with pytest.raises(Exception, match="died twice"):
            list(spread([0], dies_if, jobs=2, workers=workers))
        (third,) = spread([0], which, jobs=2, workers=workers)
        assert third != first and not alive(first)
        # Nobody waits for what is under way where a call is left before its end.
        left = spread([0, 1], which, jobs=2, workers=workers)
        next(left)
        left.close()
        assert not alive(third)
        (last,) = spread([0], which, jobs=2, workers=workers)
    assert not alive(last)


def test_means_are_kept_once():
    with Means(jobs=2).kept() as means, means.kept() as inner:
        assert inner is means and means.workers is not None
    for none in (Means(), Means(jobs=2, executor=object())):
        with none.kept() as means:
            assert means is none


def test_the_script_is_there_again_where_threads_overlap():
    script = sys.modules["__main__"]
    inside, left = threading.Event(), threading.Event()

    def other():
        with processes._without_main():
            inside.set()
            left.wait(60)
            assert sys.modules["__main__"] is not script

    with ThreadPoolExecutor(1) as threads:
        with processes._without_main():
            its = threads.submit(other)
            assert inside.wait(60)
        left.set()
        its.result(60)
    assert sys.modules["__main__"] is script
