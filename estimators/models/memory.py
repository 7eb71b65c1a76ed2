"""
All that a filter keeps in one block of memory, and the arrays in it by name.

A block is what Python hands to compiled code, which makes its views of it: that costs less than to
hand over each of fifty arrays. So a filter is copied, pickled and reset as one array.
"""

from collections.abc import Iterator, Mapping
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
        Of float64, int64, or records of these. The first, ``now``, is a record (1,): its fields are
        read and written by their names too.

    times : int, optional
        How many such blocks there are, in rows: arrays then have one more dimension, the first.

    Attributes
    ----------
    block : (size,) or (times, size) array
    at : (fields, 4) int array
        Where in a block each array begins, and its shape, with 1 for each dimension that it lacks.
    """

    def __init__(self, arrays: Mapping[str, NDArray[Any]], times: int | None = None) -> None:
        self._fields = tuple((name, a.dtype, a.shape) for name, a in arrays.items())
        parts = [np.ascontiguousarray(a).reshape(-1).view(np.float64) for a in arrays.values()]
        starts = np.cumsum([0, *map(len, parts)])
        shapes = [(*shape, *[1] * (DIMENSIONS - len(shape))) for _, _, shape in self._fields]
        self.at = np.column_stack([starts[:-1], shapes]).astype(np.int64)
        block = np.concatenate(parts)
        self.block = block if times is None else np.tile(block, (times, 1))
        self._look()

    def _look(self) -> None:
        """Make the views of the block."""
        rows = self.block.shape[:-1]
        self._views = {
            name: np.ndarray(
                (*rows, *shape), kind, self.block, 8 * start, (*of, *_steps(shape, kind))
            )
            for (name, kind, shape), start in zip(self._fields, self.at[:, 0].tolist(), strict=True)
            for of in [self.block.strides[:-1]]
        }
        self._now = self._views["now"][..., 0]

    def __getitem__(self, name: str) -> Any:
        view = self._views.get(name)
        return self._now[name][()] if view is None else view

    def __setitem__(self, name: str, value: Any) -> None:
        if name in self._views:
            self._views[name][...] = value
        else:
            self._now[name] = value

    def __iter__(self) -> Iterator[str]:
        return iter(self._views)

    def __reduce__(self) -> tuple:
        return _restored, (self._fields, self.at, self.block)

    def __deepcopy__(self, memo: object) -> "Memory":
        return self.copy()

    def copy(self) -> "Memory":
        """Return the same arrays in another block."""
        return _restored(self._fields, self.at, self.block.copy())


def _steps(shape: tuple[int, ...], kind: np.dtype) -> tuple[int, ...]:
    """Return the strides of an array whose last index runs fastest."""
    return tuple(kind.itemsize * int(np.prod(shape[i + 1 :])) for i in range(len(shape)))


def _restored(fields: tuple, at: NDArray[np.int64], block: NDArray[np.float64]) -> Memory:
    made = Memory.__new__(Memory)
    made._fields, made.at, made.block = fields, at, block
    made._look()
    return made


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
