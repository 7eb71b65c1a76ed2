"""Records of several runs side by side: fields of numbers, by name, as `sampling.runs` has them."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from llvmlite import ir

from flexaxis.estimators.sampling.emit import INDEX
from flexaxis.estimators.sampling.runs import Mask, Runs, Side

Layout = Mapping[str, tuple[int, tuple[int, ...]]]  # first word of a field, and its shape
WORD = 8  # bytes of a float or an int


class Fields:
    """
    The fields of a record, each number of which is one of R runs.

    Parameters
    ----------
    side : Side
    data : address
        Of an array (words, R).
    layout : Layout
    """

    def __init__(self, side: Side, data: ir.Value, layout: Layout) -> None:
        self.side, self.data, self.layout = side, data, layout

    def __getitem__(self, place: str | tuple) -> Runs:
        """Return a number, ``fields["P", 1, 0]``."""
        return self.side.load(self.data, INDEX(self._word(place)))

    def __setitem__(self, place: str | tuple, value: Runs | float) -> None:
        self.side.store(self.side.of(value), self.data, INDEX(self._word(place)))

    def put(self, mask: Mask, place: str | tuple, value: Runs | float) -> None:
        """Set a number where a mask holds."""
        self[place] = mask.pick(value, self[place])

    def row(self, name: str) -> list[Runs]:
        """Return the numbers of a field with one index."""
        return [self[name, i] for i in range(self.size(name))]

    def size(self, name: str) -> int:
        """Return how many rows a field has."""
        return self.layout[name][1][0]

    def _word(self, place: str | tuple) -> int:
        name, *index = (place,) if isinstance(place, str) else place
        first, shape = self.layout[name]
        return first + int(np.ravel_multi_index(index, shape, mode="wrap") if index else 0)


@lru_cache
def layout(*kinds: np.dtype) -> tuple[int, ...]:
    """
    Return where the fields of some records are, as integers that the compiler takes as constants.

    Parameters
    ----------
    *kinds : dtype
        All their fields are floats or ints of 64 bits.

    Returns
    -------
    tuple of int
        Of each field the letters of its name, first word, and shape, as `layout_of` wants it.
    """
    flat: list[int] = []
    for kind in kinds:
        fields: Mapping = kind.fields or {}
        flat.append(len(fields))
        for name, (part, where, *_) in fields.items():
            flat += [len(name), *name.encode(), where // WORD, len(part.shape), *part.shape]
    return tuple(flat)


def layout_of(flat: tuple[int, ...]) -> list[Layout]:
    """Undo `layout`."""
    rest = iter(flat)
    found: list[Layout] = []
    for count in rest:
        fields = {}
        for _ in range(count):
            name = bytes(next(rest) for _ in range(next(rest))).decode()
            first = next(rest)
            fields[name] = (first, tuple(next(rest) for _ in range(next(rest))))
        found.append(fields)
    return found
