"""The last samples of a filter in one block of memory, whatever it carried at the time."""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.carried import Carried
from flexaxis.estimators.relocate.work import CALL, WORD, Work, finished, samples_of

Array = NDArray[np.float64]
Places = NDArray[np.int64]


class Era(NamedTuple):
    """Samples from one on, in which the same was carried, and θ (p,) of all parameters else."""

    first: int
    carried: Carried
    theta: Array


class Ring:
    """
    What is remembered of the last samples, counted from the start of the filter.

    Parameters
    ----------
    length : int
        How many.

    Attributes
    ----------
    words : (length, K) array
        The rows, as numbers of eight bytes, which a compiled loop writes.
    """

    def __init__(self, length: int) -> None:
        self.length = length
        self.words = np.zeros((length, 0))
        self._eras: list[Era] = []

    def begin(self, first: int, carried: Carried, theta: Array) -> None:
        """Forget what was carried from a sample on, and carry something else."""
        finished(self.widening(first, carried))
        self._eras = [*self._before(first), Era(first, carried, theta)]

    def widening(self, first: int, carried: Carried, *, grain: float = np.inf) -> Work[None]:
        """Make room for something else from a sample on, in pieces of so many operations."""
        size = max(one.size for one in (carried, *(era.carried for era in self._before(first))))
        if size == self.words.shape[1]:
            return
        words, common = np.zeros((self.length, size)), min(size, self.words.shape[1])
        samples = samples_of(grain, WORD * size)
        for begin in range(0, self.length, samples):
            yield CALL + WORD * size * min(samples, self.length - begin)
            rows = slice(begin, begin + samples)
            words[rows, :common] = self.words[rows, :common]
        self.words = words

    def _before(self, first: int) -> list[Era]:
        """Return what was carried before a sample, but for what has been forgotten."""
        eras = [era for era in self._eras if era.first < first]
        ends = [*(era.first for era in eras), first][1:]
        return [era for era, end in zip(eras, ends, strict=True) if end > first - self.length]

    def places(self, first: int, end: int) -> Places:
        """Return where the samples from first to end are."""
        return np.arange(first, end) % self.length

    def parts(self, first: int, end: int) -> Iterator[tuple[Era, int, Places]]:
        """Yield era, first sample and places of each part of the samples from first to end."""
        for era, later in pairwise([*self._eras, None]):
            assert era is not None  # only the last is
            start, stop = max(first, era.first), min(end, later.first if later else end)
            if start < stop:
                yield era, start, self.places(start, stop)
