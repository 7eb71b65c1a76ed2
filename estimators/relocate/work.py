"""
Work that can be interrupted: before each of its pieces it says how many operations that takes.

An operation is a multiplication and an addition in a compiled loop, or what takes as long. They are
counted and not timed, so that a result does not depend on how busy the machine is.
"""

import math
from collections.abc import Generator, Iterator
from typing import TypeVar

from flexaxis.estimators.recursion.design import above_zero
from flexaxis.estimators.sampling.sampled import Terms

T = TypeVar("T")
Work = Generator[float, None, T]

PIECES = 4  # in a sample, at least
MOST = 2**62  # samples; more than there are
PER_SECOND = 4e8  # operations of a slow core, with what it does between them
CALL = 2e4  # operations, as many as small arrays and a call of compiled code take
WORD = 0.25  # operations, as many as to move a number of eight bytes takes
PAST = 5 * CALL  # operations, as many as reading the past of an alarm takes
STEP = 2 * CALL  # operations, as many as a step without work takes
LOOP = 2.0  # operations of the filter's loop over those of the model alone
PREPARE = 40.0  # operations of an element of a matrix and of its derivatives, to sample it
WHITE = 85.0  # operations, as many as to whiten one signal takes, and to sum it up
LAW = 150.0  # operations of solving for a law in a part of a sample


def finished(work: Work[T]) -> T:
    """Do work to its end, at once."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            return end.value


def bill(work: Iterator[float]) -> Iterator[float]:
    """Do work to its end, at once, and return what its pieces would have taken, one by one."""
    return iter(list(work))


def operations(deadline: float) -> float:
    """Return how many operations of work there is time for in a sample of so many seconds."""
    return above_zero("deadline", deadline, "seconds, such as 0.001") * PER_SECOND - STEP


def seconds(pieces: float) -> float:
    """Return the shortest deadline [s] of a step that does work of so many operations."""
    return (pieces + STEP) / PER_SECOND


def of_sample(terms: Terms, rows: int) -> float:
    """Return the operations of states and sensitivities, so many rows, over a sample."""
    moves = (2 + rows) * (terms.n + 1) ** 2 / 2  # two at once
    laws = terms.laws
    return moves if laws is None else laws.steps * (moves + LAW * len(laws.kind))


def to_begin(terms: Terms, rows: int) -> float:
    """Return the operations of preparing a model with so many rows."""
    return 2 * CALL + PREPARE * rows * (terms.n + 1) ** 2


def of_sum(terms: Terms, rows: int) -> float:
    """Return the operations of a sample of normal equations, whitened, of so many rows."""
    return of_sample(terms, rows) + WHITE * rows


def samples_of(grain: float, cost: float) -> int:
    """Return how many samples of a cost a piece of so many operations has; at least one."""
    return MOST if grain / cost > MOST else max(int(grain / cost), 1)


def spread_over(terms: Terms, rows: int, samples: int, grain: float) -> int:
    """Return over how many samples a stretch is spread, of which each does some pieces."""
    return 1 + math.ceil(of_sample(terms, rows) * (samples + 1) / (grain * (PIECES - 1)))
