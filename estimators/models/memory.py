"""
The memory of a filter, which consists of named arrays in one block.

Python passes the memory block to compiled code, which creates views of the arrays in the block.
Passing one block takes less time than passing fifty arrays. A filter can be copied, pickled and
reset as a single array.
"""

from collections.abc import Callable, Mapping
from copy import deepcopy
from typing import Annotated, Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

DIMENSIONS = 3  # largest number of dimensions of an array
Vector = Annotated[NDArray[np.float64], np.dtype(float), 1]
"""Annotation of a NamedTuple field for `views`: element type and number of array dimensions."""
Matrix = Annotated[NDArray[np.float64], np.dtype(float), 2]
Cube = Annotated[NDArray[np.float64], np.dtype(float), 3]
Indices = Annotated[NDArray[np.int64], np.dtype(np.int64), 1]


class Memory:
    """
    A sequence of named arrays in one memory block.

    Parameters
    ----------
    arrays : mapping of str to array
        Named arrays whose elements are float64, int64 or records of these types. If one array is
        called ``now``, the `Memory` object can also be indexed with the field names of the records
        in ``now``.
    times : int, optional
        Number of copies of the arrays; each copy is one row of ``block``. If ``times`` is given,
        each array has an additional first dimension.

    Attributes
    ----------
    block : (size,) or (times, size) array
        Memory block with the content of all arrays.
    at : (fields, 4) int array
        Start index and shape of each array in a block; ones pad each shape to three dimensions.
    """

    def __init__(self, arrays: Mapping[str, NDArray[Any]], times: int | None = None) -> None:
        kind = np.dtype([(name, a.dtype, a.shape) for name, a in arrays.items()])
        content = np.zeros(() if times is None else times, kind)
        for name, values in arrays.items():
            content[name] = values
        self.__setstate__(content)

    def __getstate__(self) -> NDArray[np.void]:
        return self._content

    def __setstate__(self, content: NDArray[np.void]) -> None:
        fields: Any = content.dtype.fields
        rows = [
            (start // 8, *kind.shape, *[1] * (DIMENSIONS - kind.ndim))
            for kind, start in fields.values()
        ]
        self._content, self.at = content, np.array(rows, np.int64)
        self.block = np.atleast_1d(content).view(np.float64).reshape((*content.shape, -1))
        self._names = frozenset(fields)
        if "now" in fields:
            self._now = np.squeeze(content["now"])

    def __getitem__(self, name: str) -> Any:
        return self._content[name] if name in self._names else self._now[name][()]

    def __setitem__(self, name: str, value: Any) -> None:
        (self._content if name in self._names else self._now)[name] = value

    def copy(self) -> "Memory":
        """Return a copy of all arrays in a new memory block."""
        return deepcopy(self)


def numbers(kind: np.dtype, values: Mapping[str, Any]) -> NDArray[np.void]:
    """Return a record array (1,) with the given field values; all other fields are zero."""
    made = np.zeros(1, kind)
    for name, value in values.items():
        made[name] = value
    return made


def views(kind: Any, block: NDArray[np.float64], at: NDArray[np.int64]) -> Any:
    """
    Return the arrays of a memory block as a NamedTuple, in Python and in compiled code.

    Parameters
    ----------
    kind : class
        Class of the NamedTuple. Each field of the NamedTuple is an array with an annotation like
        `Vector`, or another NamedTuple of arrays. The block contains the arrays in the order of the
        fields.
    block, at : arrays
        Attributes of a `Memory` object.
    """
    rows = iter(range(len(at)))

    def field(of):
        if hasattr(of, "_fields"):
            return of(*map(field, of.__annotations__.values()))
        return _view(*of.__metadata__)(block, at, next(rows))[0]

    return field(kind)


def _view(dtype: np.dtype, dimensions: int) -> Callable:
    """Return a compilable function that returns a view of one array of a memory block."""
    words = dtype.itemsize // 8

    # A compiled function without reference counting can return a view only in a tuple.
    def view(block, at, i):
        start, a, b, c = at[i, 0], at[i, 1], at[i, 2], at[i, 3]
        flat = block[start : start + a * b * c * words].view(dtype)
        if dimensions == 1:
            return (flat,)
        if dimensions == 2:
            return (flat.reshape((a, b)),)
        return (flat.reshape((a, b, c)),)

    # Numba links cached functions by name and argument types, so the name has to contain the
    # return type.
    view.__qualname__ = f"view_{dimensions}_{crc32(str(dtype).encode())}"
    return view


def register() -> None:
    """Register the function `views` with numba, so that compiled code can call it."""
    from numba import from_dtype, types
    from numba.extending import lower_builtin, type_callable

    def typed(of):
        if hasattr(of, "_fields"):
            return types.NamedTuple([*map(typed, of.__annotations__.values())], of)
        dtype, dimensions = of.__metadata__
        return types.Array(from_dtype(dtype), dimensions, "C")

    @type_callable(views)
    def _(context):
        return lambda kind, block, at: typed(kind.instance_class)

    @lower_builtin(views, types.NamedTupleClass, types.Array, types.Array)
    def _(context, builder, signature, arguments):
        rows, (kind, *given) = iter(range(1000)), signature.args

        def field(of):
            if hasattr(of, "_fields"):
                fields = [*map(field, of.__annotations__.values())]
                return context.make_tuple(builder, typed(of), fields)
            row = context.get_constant(types.intp, next(rows))
            one = types.UniTuple(typed(of), 1)(*given, types.intp)
            values = [*arguments[1:], row]
            view = context.compile_internal(builder, _view(*of.__metadata__), one, values)
            return builder.extract_value(view, 0)

        return field(kind.instance_class)
