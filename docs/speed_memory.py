"""What an estimator holds: after it is made, and whether that grows over hours of samples.

Each is measured in a process of its own, on a stream with faults, taken in pieces by `run` as a
long log is. What it holds is the length of its pickle, of all that it would need to go on
elsewhere; beside it stands what the operating system says that the process has, in which there is
also what lies outside of the estimator.
"""

from __future__ import annotations

import gc
import math
import multiprocessing
import os
import pickle
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from speed_steps import registered
from speed_streams import Samples, Stream, axis_of, make_stream

from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.sim.errors import FlexaxisError

SEED = 1
EVERY = 30.0  # s between two changes: 1200 of them in ten hours
FIRST = 0.1  # of the stream: what is held after that is what growth is measured from
PIECE = 20_000  # samples
LAST = 20  # samples of the piece before a look: what is kept of it is then always the same
LOOK = 200  # samples from one look to the next, a second: a judgement is pending for longer
CHANGES = 3  # that are looked at: in between one judges and holds more, and the largest counts
FLAT = 1.0
"""Bytes a sample: whoever grows by less keeps nothing of each sample; one number has eight."""
STATM = Path("/proc/self/statm")  # where Linux says what a process has, in pages


def memory(hours: float, estimators: Sequence[str] = ()) -> Iterator[dict[str, Any]]:
    """Yield a row for each estimator.

    Parameters
    ----------
    hours : float
        Of samples that each takes; so many at least that `CHANGES` are in the first tenth.
    estimators : sequence of str
        As an `--estimator` option names them; those that `steps` times by default.

    Yields
    ------
    dict
        As of `streamed`.

    Raises
    ------
    FlexaxisError
        If there are not hours enough, or no end of them.
    """
    least = CHANGES * EVERY / FIRST / 3600.0
    if not least <= hours < math.inf:
        raise FlexaxisError(f"{hours:g} hours: give {least:g} hours or more, and an end")
    spawn = multiprocessing.get_context("spawn")
    for name in estimators or registered():
        with ProcessPoolExecutor(1, mp_context=spawn) as pool:
            found = pool.submit(streamed, name, _stream(axis_of(name)), hours).result()
        yield found


@cache
def _stream(axis: str) -> Stream:
    return make_stream(axis, every=EVERY)


def streamed(name: str, stream: Stream, hours: float) -> dict[str, Any]:
    """Stream hours through one estimator, in this process.

    Returns
    -------
    dict
        ``estimator, hours, samples``; ``made``: bytes it holds when made; ``early, late``: the most
        at the end of the first tenth of the stream and of all of it, over `CHANGES`, and ``grown``,
        the difference (null where it cannot be pickled);
        ``resident_early, resident_late, resident_grown``: of the process, null where that is not
        known; ``findings``: told in the end, null where it tells none; ``flat``;
        ``cpu_s``: processor time of the stream [s].
    """
    compiled = build(parse(name), stream.scenario)
    run_estimator(compiled, *stream.samples(SEED).take(len(stream.u)))  # by a lap with all faults
    samples = round(hours * 3600 / stream.scenario.period)
    first = max(LOOK, round(FIRST * samples))
    window = min(first, round(CHANGES * EVERY / stream.scenario.period)) // LOOK
    estimator = build(parse(name), stream.scenario)
    made, start = _held(estimator), time.process_time()
    source = stream.samples(SEED)
    early = _take(estimator, source, first, window)
    late = _take(estimator, source, samples - first, window)
    spent = time.process_time() - start
    told = getattr(estimator, "findings", None)
    grown = {name: _less(late[name], early[name]) for name in late}
    return {
        "estimator": name,
        "hours": hours,
        "samples": samples,
        "made": made,
        "early": early["held"],
        "late": late["held"],
        "grown": grown["held"],
        "resident_early": early["resident"],
        "resident_late": late["resident"],
        "resident_grown": grown["resident"],
        "findings": None if told is None else len(told),
        "flat": max(b or 0 for b in grown.values()) < FLAT * (samples - first),
        "cpu_s": spent,
    }


def _take(estimator: Estimator, source: Samples, count: int, looks: int) -> dict[str, int | None]:
    """Run so many samples, piece by piece; return the most that is held at the last looks."""
    whole, rest = divmod(count - looks * LOOK, PIECE)
    for size in [*[PIECE] * whole, *[rest] * (rest > 0)]:
        _run(estimator, source, size)
    held = []
    for _ in range(looks):
        for size in (LOOK - LAST, LAST):
            _run(estimator, source, size)
        held.append(_held(estimator))
    most = None if None in held else max(number for number in held if number is not None)
    return {"held": most, "resident": _resident()}


def _run(estimator: Estimator, source: Samples, size: int) -> None:
    theta = run_estimator(estimator, *source.take(size))
    if not np.all(np.isfinite(theta[-1])):
        raise FloatingPointError(f"its estimates are not finite: {theta[-1]}")


def _held(estimator: Estimator) -> int | None:
    """Return the length of the pickle, None where there is none [B]."""
    try:
        return len(pickle.dumps(estimator, protocol=pickle.HIGHEST_PROTOCOL))
    except (pickle.PicklingError, TypeError, AttributeError):
        return None


def _resident() -> int | None:
    """Return what the process holds, None where that is not told [B]."""
    gc.collect()
    if not STATM.exists():
        return None
    return int(STATM.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def _less(late: int | None, early: int | None) -> int | None:
    return None if late is None or early is None else late - early
