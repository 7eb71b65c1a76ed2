"""Other futures for a record: an estimate that knows only the past is the same in all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def futures(u: Array, y: Array, cut: int) -> Iterator[tuple[str, Array, Array]]:
    """Yield what was done, and u and y (N,) with all that comes after a sample changed.

    Parameters
    ----------
    u, y : ndarray (N,)
        A record; it is left as it is.
    cut : int
        The last sample that stays.
    """
    random = np.random.default_rng(0)
    past = slice(cut + 1)
    for words, other in _FUTURES.items():
        changed = [np.r_[signal[past], other(signal[cut + 1 :], random)] for signal in (u, y)]
        yield words, changed[0], changed[1]


def _scaled(future: Array, random: np.random.Generator) -> Array:
    """Return another mean, spread and largest size, for statistics of the whole record."""
    return 3 * random.permutation(future) + 2 * future.std()


def _other(future: Array, random: np.random.Generator) -> Array:
    """Return data of another distribution, for statistics that know no scale or no offset."""
    return future.mean() - future.std() + 0.3 * future.std() * random.standard_normal(len(future))


_FUTURES: Mapping[str, Callable[[Array, np.random.Generator], Array]] = {
    "shuffled, scaled and shifted": _scaled,
    "replaced by noise": _other,
}
