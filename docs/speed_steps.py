"""How long a step takes, sample by sample from Python: not on average, but the longest of many.

Each step is timed by itself, in the processor time of this thread, which other programs on a busy
machine do not lengthen, and by the clock on the wall beside it. All steps are taken twice, and the
shorter time counts of each: what the host of a virtual machine takes away counts as time of the
thread, too, and comes to no step twice. Whatever a user has stays as it is, the collection of
garbage included.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from speed_streams import Stream, axis_of, make_stream

from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.running.estimators import build, parse

Counts = NDArray[np.int64]

PERCENTILES = {"p50": 50.0, "p99": 99.0, "p99.9": 99.9, "max": 100.0}
TIMER = "(timer)"
PIECE = 20_000  # samples that are made at a time
TIMES = 2  # that all steps are taken
SEED, WARM_UP = 1, 2  # of the noise: while it is timed, and before


def registered() -> list[str]:
    """Return the names of all estimators that are timed by name."""
    return list(REGISTRY)


def restart(estimator: Any) -> None:
    """Take an estimator back to its start, where it can be."""
    if hasattr(estimator, "reset"):
        estimator.reset()


def steps(
    count: int, estimators: Sequence[str] = (), *, streams: Sequence[bool] = (False, True)
) -> Iterator[dict[str, Any]]:
    """Yield a row for each estimator and stream, that of the timer first.

    Parameters
    ----------
    count : int
        Steps of each.
    estimators : sequence of str
        As an `--estimator` option names them; all that are registered by default.
    streams : sequence of bool
        Whether there are faults.

    Yields
    ------
    dict
        ``estimator, axis, faults, steps``; ``cpu_us`` and ``wall_us``: each ``p50, p99, p99.9,
        max`` [µs], the timer's own time in them; ``of_period``: longest in processor time over the
        sampling period; ``findings``: how many, null where it tells none.
    """
    yield {"estimator": TIMER, "axis": "linear", "faults": False} | _timed(
        _Nothing, count, _stream("linear", False)
    )
    for name in estimators or registered():
        axis = axis_of(name)
        for faults in streams:
            stream = _stream(axis, faults)
            row = {"estimator": name, "axis": axis, "faults": faults}
            yield row | _timed(partial(_ready, name, axis, stream), count, stream)


class _Nothing:
    """What a step costs that does nothing."""

    names, output = (), "speed"

    def step(self, u: float, y: float | None) -> tuple[()]:
        return ()


@cache
def _stream(axis: str, faults: bool) -> Stream:
    return make_stream(axis, faults=faults)


def _ready(name: str, axis: str, stream: Stream) -> Estimator:
    estimator = build(parse(name), stream.scenario)
    warm(estimator, axis)
    return estimator


def warm(estimator: Estimator, axis: str) -> None:
    """Let it compile what it compiles, also when something changes; then take it to its start."""
    stream = _stream(axis, True)
    u, y = stream.samples(WARM_UP).take(len(stream.u))
    run_estimator(estimator, u, y)
    for torque, speed in zip(u[:10].tolist(), y[:10].tolist(), strict=True):
        estimator.step(torque, speed)
    restart(estimator)


def _timed(make: Callable[[], Any], count: int, stream: Stream) -> dict[str, Any]:
    estimators = [make() for _ in range(TIMES)]
    times = []
    for estimator in estimators:
        gc.collect()  # so that the next collection comes to the same step
        times.append(time_steps(estimator, stream, count))
    cpu, wall = np.min(times, axis=0)
    told = getattr(estimators[0], "findings", None)
    return {
        "steps": count,
        "cpu_us": _spread(cpu),
        "wall_us": _spread(wall),
        "of_period": 1e-9 * float(cpu.max()) / stream.scenario.period,
        "findings": None if told is None else len(told),
    }


def time_steps(estimator: Any, stream: Stream, count: int) -> tuple[Counts, Counts]:
    """Step through a stream, and return what each step took.

    Parameters
    ----------
    estimator : Estimator
    stream : Stream
    count : int

    Returns
    -------
    cpu, wall : ndarray (count,) of int
        Processor time of this thread, and time on the wall [ns].
    """
    cpu, wall = np.empty(count, np.int64), np.empty(count, np.int64)
    thread, clock, step = time.thread_time_ns, time.perf_counter_ns, estimator.step
    source = stream.samples(SEED)
    for first in range(0, count, PIECE):
        u, y = source.take(min(PIECE, count - first))
        for k, (torque, speed) in enumerate(zip(u.tolist(), y.tolist(), strict=True), first):
            began, start = clock(), thread()
            step(torque, speed)
            stop, ended = thread(), clock()
            cpu[k], wall[k] = stop - start, ended - began
    return cpu, wall


def _spread(nanoseconds: Counts) -> dict[str, float]:
    found = np.percentile(nanoseconds, list(PERCENTILES.values()))
    return dict(zip(PERCENTILES, (1e-3 * found).tolist(), strict=True))
