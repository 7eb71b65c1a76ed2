"""Prediction-error methods side by side: which of them fit together, and how a block is run."""

from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.methods.rpem import Rpem, rpem_loop
from flexaxis.estimators.sampling.compiler import Compiled
from flexaxis.estimators.sampling.fields import WORD, layout
from flexaxis.estimators.sampling.pattern import Pattern

Array = NDArray[np.float64]
Signals = tuple[Array, Array, NDArray[np.bool_]]

PAYS = 8_000_000  # run-samples, of which side by side saves as much time as compiling for it takes
SOUND = ("theta", "P", "claim", "X", "noise", "signal")  # what is not finite in these stays so

_came: Counter = Counter()  # run-samples of each kind, in this process


class Kind(NamedTuple):
    """What runs must share to stand side by side."""

    pattern: Pattern
    records: tuple[int, ...]
    order: int
    substeps: int


def kind_of(estimator: object) -> Kind | None:
    """Return what those beside an estimator must share with it; None if it has to run alone."""
    if type(estimator) is not Rpem:  # one that is derived from it may do anything
        return None
    make, given = estimator._loop.origin or (None, ())
    if make is not rpem_loop or given[0].laws or estimator._restarts:
        return None
    tuning, state = estimator._tuning, estimator.state
    if not all(np.array_equal(state[name][0], state[name][0].T) for name in ("P", "claim")):
        return None
    records = layout(tuning.dtype, state.dtype)
    return Kind(given[0], records, int(tuning["order"][0]), int(tuning["substeps"][0]))


def take_together(
    kind: Kind, runs: Sequence[tuple[Any, Signals]], *, patient: bool
) -> list[Array | None]:
    """
    Let filters take samples, and return their estimates (N, p); None for those left as they were.

    Parameters
    ----------
    kind : Kind
        That of all of them.
    runs : sequence of (filter, (u, y, valid))
        Signals are of one length N.
    patient : bool
        As for `flexaxis.estimators.side_by_side.run_together`.
    """
    width = registers()
    N, alone = len(runs[0][1][0]), [None] * len(runs)
    if width == 0 or N == 0 or len(runs) < width // 2:
        return list(alone)
    _came[kind] += N * len(runs)
    loop = _loop(kind, width)
    if patient and _came[kind] < PAYS and not loop.kept(*_arguments(kind, runs[:1], width, 0)):
        return list(alone)
    found: list[Array | None] = []
    for first in range(0, len(runs), width):
        block = runs[first : first + width]
        # so many take no longer alone, one after the other, than a register that is half empty
        found += alone[: len(block)] if len(block) < width // 2 else _take(kind, loop, block, width)
    return found


@lru_cache
def registers() -> int:
    """Return how many numbers a register has on this machine; 0 where nothing is compiled."""
    from numba import config
    from numba.core.registry import cpu_target

    from flexaxis.estimators.sampling.runs import width

    return 0 if config.DISABLE_JIT else width(cpu_target.target_context)


def _loop(kind: Kind, width: int) -> Compiled:
    from flexaxis.estimators.recursion.beside_loop import beside_loop  # imports the compiler

    return beside_loop(kind.pattern, kind.records, width)


def _arguments(kind: Kind, runs: Sequence[tuple[Any, Signals]], width: int, N: int) -> tuple:
    """Return what the loop takes: the runs, and the last of them again up to the width."""
    filled = [*runs, *[runs[-1]] * (width - len(runs))]
    tuning, state = (
        np.stack([record.view(float) for record in records], axis=-1)
        for records in zip(*((each._tuning, each.state) for each, _ in filled), strict=True)
    )
    signals = (
        np.stack([each[:N] for each in some])
        for some in zip(*(given for _, given in filled), strict=True)
    )
    series = runs[0][0]._tuning["weights"][0], kind.order, kind.substeps
    out = (np.empty((width, N, count)) for count in (kind.pattern.p, 3))
    return (tuning, state, series, *signals, *out)


def _take(
    kind: Kind, loop: Compiled, runs: Sequence[tuple[Any, Signals]], width: int
) -> list[Array | None]:
    arguments = _arguments(kind, runs, width, len(runs[0][1][0]))
    loop(*arguments)
    _, state, *_, estimates, trace = arguments
    return [
        _leave(each, state[:, r].copy(), estimates[r], trace[r])
        for r, (each, _) in enumerate(runs)
    ]


def _leave(each: Rpem, words: Array, estimates: Array, trace: Array) -> Array | None:
    """Leave a filter in its last state; None where numbers are none: alone they spread otherwise."""
    state = words.view(each.state.dtype)
    if not all(np.isfinite(state[name]).all() for name in SOUND):
        return None
    state["taken"] += len(estimates)
    each.state[:], each._trace = state, trace
    estimates *= each._design.scale
    return estimates
