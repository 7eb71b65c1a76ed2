"""A run in 3-D, `view`, and the cache of simulated records, `cache`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from flexaxis.experiments.demo.view import view

__all__ = ["CacheState", "cache", "view"]


@dataclass(frozen=True)
class CacheState:
    """The cache of simulated records.

    Attributes
    ----------
    folder : Path
        Where the records are; the environment variable FLEXAXIS_CACHE sets it.
    records : int
        Number of records.
    size_mb, limit_mb : float
        Their size and its limit [MB].
    removed : int
        Number of records that were removed.
    """

    folder: Path
    records: int
    size_mb: float
    limit_mb: float
    removed: int = 0


def cache(*, clear: bool = False) -> CacheState:
    """Return the state of the cache of simulated records, or empty it.

    A record is stored under the hash of its scenario, its seed, the engine and the simulation code,
    so an entry is never out of date. The least recently used records go when the limit is reached.

    Parameters
    ----------
    clear : bool
        Whether to remove all records.

    Examples
    --------
    >>> import flexaxis as fx
    >>> fx.cache().removed
    0
    """
    from flexaxis.experiments.running.cache import default_cache

    store = default_cache()
    removed = store.evict(-1) if clear else 0
    size, limit = (round(bytes_ / 1024**2, 1) for bytes_ in (store.size(), store.limit))
    return CacheState(store.folder, len(store.entries()), size, limit, removed)
