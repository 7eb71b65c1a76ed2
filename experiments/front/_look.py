"""A run in 3-D, `view`, and the cache of simulated records, `cache`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from flexaxis.sim.errors import FlexaxisError

if TYPE_CHECKING:
    from flexaxis._given import Scenarios
    from flexaxis.sim.record import Record


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


def view(
    run: Scenarios | Record,
    *,
    seed: int = 0,
    at: float = 0.0,
    exaggerate: float = 100.0,
    picture: str | Path | None = None,
) -> Path | None:
    """Show a run in 3-D: in a window, or as a picture.

    The twist of the joints is about a milliradian. The angles of gear and arm are therefore
    exaggerated; the motor turns as it does.

    Parameters
    ----------
    run : str, Scenario or Record
        A scenario, which is simulated first, or a recording of `simulate` or `load`.
    seed : int
        Seed of the simulation.
    at : float
        Time of the run at which to begin [s].
    exaggerate : float
        Factor of the twist; 1 shows it as it is.
    picture : str or Path, optional
        PNG file to write instead of opening a window. It needs no display.

    Returns
    -------
    Path or None
        The picture.

    Raises
    ------
    FlexaxisError
        If a number or the name of the picture is wrong.
    """
    target = None if picture is None else Path(picture)
    _check(at, exaggerate, target)
    from flexaxis.experiments.demo import view as drawing

    if target is not None:
        drawing.draw_offscreen()  # before the engine is imported
    from flexaxis._given import scenarios_of
    from flexaxis.sim.record import Record
    from flexaxis.sim.simulate import simulate

    record = run if isinstance(run, Record) else simulate(scenarios_of(run)[0], [seed])[0]
    if at > record.time[-1]:
        last = record.time[-1]
        raise FlexaxisError(f"at={at:g}: the run ends at {last:g} s; give an earlier time")
    if target is None:
        drawing.window(record, start=at, exaggerate=exaggerate)
    else:
        drawing.picture(record, target, at=at, exaggerate=exaggerate)
    return target


def _check(at: float, exaggerate: float, picture: Path | None) -> None:
    """Refuse numbers and names that no picture can be made of."""
    if not 0 <= at < float("inf"):
        raise FlexaxisError(f"at={at:g}: give a time of the run [s], 0 or later")
    if not 0 <= exaggerate < float("inf"):
        raise FlexaxisError(f"exaggerate={exaggerate:g}: give a finite factor, 0 or more")
    if picture is not None and picture.suffix.lower() != ".png":
        raise FlexaxisError(
            f"picture={str(picture)!r}: pictures are written as PNG, so give a name that ends in "
            f".png, such as {picture.stem or 'axis'}.png"
        )
