"""An opened log: the names and units of its columns, and their numbers when they are asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.errors import LogError
from flexaxis.sim.errors import did_you_mean

Array = NDArray[np.float64]

WIDEST = 64  # columns that a matrix may have, so that a picture is not taken for signals
LONGEST = 200_000_000  # samples of a column: 1.6 GB
SHOWN = 40  # names in a message


class Reader(Protocol):
    """Returns columns (N,) by name, NaN where a value is missing."""

    def __call__(self, names: Sequence[str], *, strict: bool = True) -> Mapping[str, Array]:
        """Return them; a column of texts is an error, or left out if not strict."""
        ...


@dataclass(frozen=True)
class Log:
    """What a file holds: sequences of numbers by name, not yet read.

    Attributes
    ----------
    source : str
        File name, for messages.
    names : tuple of str
    read : Reader
        Reads columns; see `load` and `numbers`.
    units : dict of str to str
        Units as the file states them, of some columns.
    """

    source: str
    names: tuple[str, ...]
    read: Reader
    units: Mapping[str, str] = field(default_factory=dict)

    def load(self, names: Sequence[str]) -> dict[str, Array]:
        """Return some columns.

        Raises
        ------
        LogError
            If there is none of such a name, or it does not hold numbers.
        """
        for name in names:
            if name not in self.names:
                raise LogError(
                    f"{self.source}: there is no column {name!r}."
                    f"{did_you_mean(name, self.names)} There are {shown(self.names)}"
                )
        return dict(self.read(list(dict.fromkeys(names))))

    def numbers(self) -> dict[str, Array]:
        """Return all columns that hold numbers."""
        return dict(self.read(self.names, strict=False))


def shown(names: Sequence[str]) -> str:
    """Return names for a message, the first forty of very many."""
    text = ", ".join(names[:SHOWN])
    more = len(names) - SHOWN
    return f"{text} and {more} more" if more > 0 else text


def columns_of(name: str, array: Any) -> Iterator[tuple[str, Array]]:
    """Yield the columns that an array holds, the long side of a matrix as time; else none."""
    array = np.asarray(array)
    if array.dtype.kind not in "fiub" or array.dtype.names is not None:
        return
    array = np.squeeze(array)
    if array.ndim == 1 and array.size > 1:
        yield name, array.astype(float)
    if array.ndim != 2:
        return
    tall = array if array.shape[0] >= array.shape[1] else array.T
    if tall.shape[1] > WIDEST:
        return
    for j, column in enumerate(tall.T):
        yield f"{name}[{j}]", column.astype(float)
