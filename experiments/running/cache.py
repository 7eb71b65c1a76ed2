"""Simulated records kept for the next run, addressed by their content.

A record is known by what plant and sensors see of its scenario (`Scenario.record_hash`), its seed,
the version of the engine and digests of the MJCF and of our simulation code, so that a change of
any of them simulates anew, and a change of what estimators are told or asked does not. Entries are
written at once or not at all, carry checksums, and the least recently used ones go when the folder
is full.
"""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np

from flexaxis.experiments.scoring.nominal import nominal_runs
from flexaxis.experiments.storage.files import digest_of
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.files import atomic
from flexaxis.sim.record import SIGNALS, Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import made_with, simulate

LIMIT = 2 * 1024**3  # bytes
SHARE = 1 / 64  # of its limit, by which a process may overfill a folder before it looks again
_put: dict[Path, int] = {}
"""Bytes that this process has put into each folder since it last looked how full that is."""


@dataclass(frozen=True)
class RecordCache:
    """A folder of records, and how large it may grow [bytes]."""

    folder: Path
    limit: int = LIMIT

    def get(self, scenario: Scenario, seed: int, *, repeat: int = 0) -> Record | None:
        """Return a record, or None if it is not here; a damaged entry is removed."""
        path, run = self._path(scenario, seed, repeat), scenario.drawn(seed)
        try:
            with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as stored:
                record = Record(
                    **{name: stored[name] for name in SIGNALS if name in stored},
                    true_parameters=run.true_parameters(),
                    parameter_names=scenario.parameter_names,
                    scenario=run.resolved(),
                    hash=scenario.hash,
                    seed=seed,
                    burn_in=scenario.burn_in,
                    versions=made_with(scenario),
                )
            os.utime(path)  # used just now
        except OSError:  # not there, or not readable
            return None
        except Exception:  # a damaged file fails in many ways
            path.unlink(missing_ok=True)
            return None
        return record

    def put(self, scenario: Scenario, record: Record, *, repeat: int = 0) -> None:
        """Keep a record; a folder that is full or cannot be written is no error."""
        path = self._path(scenario, record.seed or 0, repeat)
        with suppress(OSError):
            self.folder.mkdir(parents=True, exist_ok=True)
            with atomic(path) as new:
                known = {name: getattr(record, name) for name in SIGNALS}
                np.savez(new, **{name: x for name, x in known.items() if x is not None})
            if self.folder in _put:
                _put[self.folder] += _size(path)

    def make_room(self) -> None:
        """Evict, but for a process that has put little since it last did.

        To look at a folder of thousands takes as long as to simulate a record.
        """
        if _put.get(self.folder, self.limit) > SHARE * self.limit:
            self.evict()
            _put[self.folder] = 0

    def entries(self) -> list[Path]:
        """Return the files, the least recently used first."""
        found = []
        for path in self.folder.glob("*.npz"):
            with suppress(FileNotFoundError):  # another process may evict at the same time
                found.append((path.stat().st_mtime_ns, path))
        return [path for _, path in sorted(found)]

    def size(self) -> int:
        """Return the size of all entries [bytes]."""
        return sum(_size(path) for path in self.entries())

    def evict(self) -> int:
        """Remove the least recently used entries until the limit is met; return how many."""
        entries = self.entries()
        total, removed = sum(map(_size, entries)), 0
        for path in entries:
            if total <= self.limit:
                break
            total -= _size(path)
            path.unlink(missing_ok=True)
            removed += 1
        return removed

    def clear(self) -> int:
        """Remove all entries; return how many."""
        entries = self.entries()
        for path in entries:
            path.unlink(missing_ok=True)
        return len(entries)

    def _path(self, scenario: Scenario, seed: int, repeat: int = 0) -> Path:
        run = f"{seed}.{repeat}" if repeat else f"{seed}"
        code = digest_of("models_mjcf", "sim")
        key = f"{scenario.record_hash} {run} {sorted(made_with(scenario).items())} {code}"
        return self.folder / f"{sha256(key.encode()).hexdigest()}.npz"


def default_cache() -> RecordCache:
    """Return the user's cache: the folder in FLEXAXIS_CACHE, else one in the user's cache folder.

    FLEXAXIS_CACHE_LIMIT sets its size in MB (default 2048).

    Raises
    ------
    FlexaxisError
        If the limit is no number.
    """
    from flexaxis.estimators.models.compiler import user_cache

    folder = os.environ.get("FLEXAXIS_CACHE")
    limit = os.environ.get("FLEXAXIS_CACHE_LIMIT", str(LIMIT // 1024**2))
    if not limit.isdigit():
        raise FlexaxisError(f"FLEXAXIS_CACHE_LIMIT is {limit!r}: give a whole number of MB")
    path = Path(folder) if folder else user_cache() / "flexaxis" / "records"
    return RecordCache(path, int(limit) * 1024**2)


def records(
    scenario: Scenario, seeds: Sequence[int], store: RecordCache | None, *, repeat: int = 0
) -> tuple[list[Record], int]:
    """Return the records of some seeds, simulating those that the cache lacks, and their number.

    A cached record is bit for bit what simulating it gives, whatever the batch.
    """
    known = {seed: store.get(scenario, seed, repeat=repeat) for seed in seeds} if store else {}
    missing = [seed for seed in seeds if known.get(seed) is None]
    made = simulate(scenario, missing, repeat=repeat) if missing else []
    for seed, record in zip(missing, made, strict=True):
        known[seed] = record
        if store:
            store.put(scenario, record, repeat=repeat)
    if store and made:
        store.make_room()
    return [record for record in known.values() if record], len(missing)


def kept_runs(store: RecordCache | None) -> AbstractContextManager[None]:
    """Keep the nominal runs, too, that are simulated inside: each serves many scenarios."""
    return nominal_runs(lambda scenario: records(scenario, [0], store)[0][0].torque)


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0
