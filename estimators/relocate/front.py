"""A filter of a moment that goes on by itself, and nothing remembers: the present of a late one."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.recursion.records import Record
from flexaxis.estimators.relocate.carried import Carried
from flexaxis.estimators.relocate.rows import OF_ALL, words_of

Array = NDArray[np.float64]


class Front:
    """
    The compiled loop on records of its own.

    Parameters
    ----------
    carried : Carried
    tuning, state : (1,) records
        Of what is carried.
    theta : (p,) array
        All parameters.
    kind : dtype
        As of a `Present`.
    """

    def __init__(
        self, carried: Carried, tuning: Record, state: Record, theta: Array, kind: np.dtype
    ) -> None:
        self._carried, self._tuning, self._state, self._kind = carried, tuning, state, kind
        self._theta, self._ring = theta, np.zeros((1, carried.size))
        state["armed"] = state["learning"] = state["turning"] = 0
        state["stop"] = -1

    def run(
        self, u: Array, y: Array, present: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> int:
        """Take samples, as `flexaxis.estimators.relocate.memory.Memory` does."""
        records = self._tuning, self._state
        return taken(
            self._carried, records, self._theta, self._ring, (u, y, present, estimates, trace)
        )

    @property
    def state(self) -> "Present":
        """The filter, ready for the next measurement."""
        return Present(self._carried, self._state, self._theta, self._kind)


def taken(
    carried: Carried,
    records: tuple[Record, Record],
    theta: Array,
    ring: Array,
    samples: tuple[Array, Array, NDArray[np.bool_], Array, Array],
) -> int:
    """
    Take samples until an alarm goes off or the count reaches ``stop``; return how many.

    Parameters
    ----------
    carried : Carried
    records : tuning, state
        Of what is carried.
    theta : (p,) array
        All parameters.
    ring : (length, K) array
        Where the past goes.
    samples : u (N,), y (N,), present (N,), estimates (N, q), trace (N, 3)
        Estimates are those of the first q parameters.
    """
    u, y, present, estimates, trace = samples
    mine, q = carried.places, estimates.shape[1]
    every = len(mine) >= q and mine[q - 1] == q - 1
    mine = mine[mine < q]
    found = estimates if every else np.empty((len(u), len(mine)))
    words = words_of(records[1])
    count = int(carried.loop(*records, u, y, present, found, trace, words, ring))
    if not every:
        estimates[:count] = theta[:q]
        estimates[:count, mine] = found[:count]
    return count


class Present:
    """
    A filter as it is now; what there is of every parameter, of all of them.

    Parameters
    ----------
    carried : Carried
    state : (1,) record
        Of what is carried.
    theta : (p,) array
        All parameters; of those that are carried, some time ago.
    kind : dtype
        Of what is remembered of a sample, of all parameters.
    """

    def __init__(self, carried: Carried, state: Record, theta: Array, kind: np.dtype) -> None:
        self._carried, self._state, self._theta, self._kind = carried, state, theta, kind

    def __getitem__(self, name: str) -> Any:
        if name not in OF_ALL:
            return self._state[name][0]
        values = self._theta.copy() if name == "theta" else np.zeros(self._kind[name].shape)
        self._carried.spread(name, self._state[name], values[None])
        return values

    def __setitem__(self, name: str, value: object) -> None:
        if name in OF_ALL:
            raise KeyError(f"{name} of a filter changes by a rewind alone")
        self._state[name] = value
