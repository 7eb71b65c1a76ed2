"""The last samples of a filter in one block of memory, whatever it carried at the time."""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.carried import Carried

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
        eras = [*(era for era in self._eras if era.first < first), Era(first, carried, theta)]
        # with what has been forgotten goes the room that it took
        last = [era for era, later in pairwise(eras) if later.first > first - self.length]
        self._eras = [*last, eras[-1]]
        size = max(era.carried.size for era in self._eras)
        if size != self.words.shape[1]:
            words, common = np.zeros((self.length, size)), min(size, self.words.shape[1])
            words[:, :common] = self.words[:, :common]
            self.words = words

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
