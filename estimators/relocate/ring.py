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
    """Samples from one on, in which the same was carried, and all parameters were θ (p,) else."""

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
        The rows, as numbers of eight bytes each, which a compiled loop writes.
    """

    def __init__(self, length: int) -> None:
        self.length = length
        self.words = np.zeros((length, 0))
        self._eras: list[Era] = []

    def begin(self, first: int, carried: Carried, theta: Array) -> None:
        """Forget all from a sample on, and begin there with another choice of what is carried."""
        eras = [era for era in self._eras if era.first < first]
        eras.append(Era(first, carried, theta.copy()))
        ends = [era.first for era in eras[1:]] + [first + 1]
        kept = zip(eras, ends, strict=True)
        self._eras = [era for era, end in kept if end > first - self.length]
        size = max(era.carried.size for era in self._eras)
        if size != self.words.shape[1]:
            words = np.zeros((self.length, size))
            common = min(size, self.words.shape[1])
            words[:, :common] = self.words[:, :common]
            self.words = words

    def parts(self, first: int, end: int) -> Iterator[tuple[Era, int, Places]]:
        """Yield era, first sample and places of each part of the samples from first to end."""
        for era, later in pairwise([*self._eras, None]):
            assert era is not None  # only the last is
            start, stop = max(first, era.first), min(end, later.first if later else end)
            if start < stop:
                yield era, start, np.arange(start, stop) % self.length
