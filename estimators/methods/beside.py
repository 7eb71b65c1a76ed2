"""Prediction-error methods side by side: which of them fit together, and how a block is run."""

from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.methods.rpem import Rpem
from flexaxis.estimators.recursion.astray import HEEDS_ALL
from flexaxis.estimators.sampling.compiler import Compiled
from flexaxis.estimators.sampling.fields import layout, layout_of
from flexaxis.estimators.sampling.pattern import Pattern

Array = NDArray[np.float64]
Signals = tuple[Array, Array, NDArray[np.bool_]]

LEAST = 4  # runs that take as long one after the other as a register of them
PAYS = {8: 5_000_000, 4: 15_000_000}  # run-samples for which side by side, with registers of so
# many, saves the time that compiling takes, .35 s
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
    loop = estimator._loop
    assert isinstance(loop, Compiled)
    pattern = loop.origin[1][0] if loop.origin else None
    if pattern is None or pattern.laws or estimator._tuning["heeds"][0] == HEEDS_ALL:
        return None
    tuning, state = estimator._tuning, estimator.state
    words, (_, lower, upper) = state.view(float), _places(state.dtype)
    if not np.array_equal(words[lower], words[upper]):
        return None
    records = layout(tuning.dtype, state.dtype)
    return Kind(pattern, records, int(tuning["order"][0]), int(tuning["substeps"][0]))


def is_worth(kind: Kind, runs: int, samples: int) -> bool:
    """
    Return whether so many runs of a kind are better run together; what that needs is compiled now.

    Parameters
    ----------
    kind : Kind
    runs, samples : int
        How many runs, and samples of each.
    """
    width = registers()
    if width == 0 or runs < LEAST:
        return False
    _came[kind] += runs * samples
    loop, nothing = _loop(kind, width), _nothing(kind, width)
    if _came[kind] < PAYS[width] and not loop.kept(*nothing):
        return False
    loop(*nothing)
    return True


def take_together(kind: Kind, runs: Sequence[tuple[Any, Signals]]) -> list[Array | None]:
    """
    Let filters take samples, and return their estimates (N, p); None for those left as they were.

    Parameters
    ----------
    kind : Kind
        That of all of them.
    runs : sequence of (filter, (u, y, valid))
        Signals are of one length N.
    """
    width = registers()
    found: list[Array | None] = []
    for first in range(0, len(runs), width or len(runs)):
        block = runs[first : first + width] if width else runs
        if width == 0 or len(block) < LEAST or len(block[0][1][0]) == 0:
            found += [None] * len(block)
        else:
            found += _take(kind, _loop(kind, width), block, width)
    return found


@lru_cache
def _places(kind: np.dtype) -> tuple[NDArray[np.int64], ...]:
    """Return which words of a state are in `SOUND`, and which of P and Σ mirror each other."""
    (fields,) = layout_of(layout(kind))
    words = {
        name: at + np.arange(prod(shape)).reshape(shape) for name, (at, shape) in fields.items()
    }
    matrices = [words["P"], words["claim"]]
    return (
        np.concatenate([words[name].ravel() for name in SOUND]),
        np.concatenate([matrix.ravel() for matrix in matrices]),
        np.concatenate([matrix.T.ravel() for matrix in matrices]),
    )


@lru_cache
def registers() -> int:
    """Return how many numbers a register has on this machine; 0 where nothing is compiled."""
    import numba
    from numba.core.registry import cpu_target

    from flexaxis.estimators.sampling.runs import width

    nothing = numba.config.DISABLE_JIT  # type: ignore[attr-defined]
    return 0 if nothing else width(cpu_target.target_context)


def _loop(kind: Kind, width: int) -> Compiled:
    from flexaxis.estimators.recursion.beside_loop import beside_loop  # imports the compiler

    return beside_loop(kind.pattern, kind.records, width)


def _nothing(kind: Kind, width: int) -> tuple:
    """Return what the loop takes, with no samples in it."""
    records = np.empty((0, width)), np.empty((0, width))
    series = np.empty(0), kind.order, kind.substeps
    signals = np.empty((width, 0)), np.empty((width, 0)), np.empty((width, 0), bool)
    return (*records, series, *signals, np.empty((width, 0, 0)), np.empty((width, 0, 0)))


def _arguments(kind: Kind, runs: Sequence[tuple[Any, Signals]], width: int) -> tuple:
    """Return what the loop takes: the runs, and the last of them again up to the width."""
    filled = [*runs, *[runs[-1]] * (width - len(runs))]
    tuning, state = (
        np.stack([record.view(float) for record in records], axis=-1)
        for records in zip(*((each._tuning, each.state) for each, _ in filled), strict=True)
    )
    signals = [np.stack(some) for some in zip(*(given for _, given in filled), strict=True)]
    series = runs[0][0]._tuning["weights"][0], kind.order, kind.substeps
    out = (np.empty((*signals[0].shape, count)) for count in (kind.pattern.p, 3))
    return (tuning, state, series, *signals, *out)


def _take(
    kind: Kind, loop: Compiled, runs: Sequence[tuple[Any, Signals]], width: int
) -> list[Array | None]:
    arguments = _arguments(kind, runs, width)
    loop(*arguments)
    _, state, *_, estimates, trace = arguments
    return [
        _leave(each, state[:, r].copy(), estimates[r], trace[r]) for r, (each, _) in enumerate(runs)
    ]


def _leave(each: Rpem, words: Array, estimates: Array, trace: Array) -> Array | None:
    """
    Leave a filter in its last state; None where it has to go alone.

    That is where not all is finite, which spreads otherwise, and where it was to begin anew.
    """
    state = words.view(each.state.dtype)
    lost = state["anew"][0] > each._tuning["heeds"][0]
    if lost or not np.isfinite(words[_places(state.dtype)[0]]).all():
        return None
    state["taken"] += len(estimates)
    each.state[:], each._trace = state, trace
    estimates *= each._design.scale
    return estimates
