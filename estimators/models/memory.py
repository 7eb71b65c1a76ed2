"""
All that a filter keeps in one block of memory, and the arrays in it by name.

A block is what Python hands to compiled code, which makes its views of it: that costs less than to
hand over each of fifty arrays. So a filter is copied, pickled and reset as one array.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.compiler import inlined

DIMENSIONS = 3  # at most


class Memory:
    """
    Arrays one behind the other in a block.

    Parameters
    ----------
    arrays : mapping of str to array
        Of float64, int64, or records of these. The first, ``now``, is a record (1,), or several: by
        their names its fields are read and written too.

    times : int, optional
        How many such blocks there are, in rows: arrays then have one more dimension, the first.

    Attributes
    ----------
    block : (size,) or (times, size) array
    at : (fields, 4) int array
        Where in a block each array begins, and its shape, with 1 for each dimension that it lacks.
    """

    def __init__(self, arrays: Mapping[str, NDArray[Any]], times: int | None = None) -> None:
        kind = np.dtype([(name, a.dtype, a.shape) for name, a in arrays.items()])
        content = np.zeros(() if times is None else times, kind)
        for name, values in arrays.items():
            content[name] = values
        starts = [kind.fields[name][1] // 8 for name in arrays]  # type: ignore[index]
        shapes = [(*a.shape, *[1] * (DIMENSIONS - a.ndim)) for a in arrays.values()]
        self.__setstate__((np.column_stack([starts, shapes]).astype(np.int64), content))

    def __getstate__(self) -> tuple[NDArray[np.int64], NDArray[np.void]]:
        return self.at, self._content

    def __setstate__(self, state: tuple[NDArray[np.int64], NDArray[np.void]]) -> None:
        self.at, self._content = state
        words = np.atleast_1d(self._content).view(np.float64)
        self.block = words.reshape((*self._content.shape, -1))
        self._names = frozenset(self._content.dtype.names or ())
        if "now" in self._names:
            now = self._content["now"]
            self._now = now[..., 0] if now.shape[-1] == 1 else now

    def __getitem__(self, name: str) -> Any:
        return self._content[name] if name in self._names else self._now[name][()]

    def __setitem__(self, name: str, value: Any) -> None:
        (self._content if name in self._names else self._now)[name] = value

    def __deepcopy__(self, memo: object) -> "Memory":
        return self.copy()

    def copy(self) -> "Memory":
        """Return the same arrays in another block."""
        other = Memory.__new__(Memory)
        other.__setstate__((self.at, self._content.copy()))
        return other


def numbers(kind: np.dtype, values: Mapping[str, Any]) -> NDArray[np.void]:
    """Return a record (1,) of a type with these values, and zero elsewhere."""
    made = np.zeros(1, kind)
    for name, value in values.items():
        made[name] = value
    return made


# A function that counts no references may not return a view by itself, but in a tuple.


@inlined
def items(block, at):
    """Return the numbers of an array, one behind the other, as a tuple of one."""
    return (block[at[0] : at[0] + at[1] * at[2] * at[3]],)


@inlined
def records(block, at, words):
    """Return the numbers of an array of records, each as long as so many, as a tuple of one."""
    return (block[at[0] : at[0] + at[1] * words],)


@inlined
def matrix(block, at):
    """Return a matrix of a block, as a tuple of one."""
    return (items(block, at)[0].reshape((at[1], at[2])),)


@inlined
def cube(block, at):
    """Return an array with three dimensions of a block, as a tuple of one."""
    return (items(block, at)[0].reshape((at[1], at[2], at[3])),)
