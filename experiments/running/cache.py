"""Simulated records kept for the next run: one NetCDF file each, the least recently used go first.

A record is known by what plant and sensors see of its scenario (`Scenario.record_hash`), its seed,
the version of MuJoCo and a digest of the simulation code and the MJCF.
"""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import h5netcdf
import h5py

from flexaxis.experiments.files import digest_of
from flexaxis.experiments.scoring.nominal import nominal_runs
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.files import atomic
from flexaxis.sim.record import SIGNALS, Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import made_with, simulate

LIMIT = 2048  # MB


@dataclass(frozen=True)
class RecordCache:
    """A folder of records, and how large it may grow [bytes]."""

    folder: Path
    limit: int = LIMIT * 1024**2

    def get(self, scenario: Scenario, seed: int, *, repeat: int = 0) -> Record | None:
        """Return a record, or None if it is not here; a damaged file is removed."""
        path, run = self._path(scenario, seed, repeat), scenario.drawn(seed)
        try:
            with h5py.File(path) as file:
                signals = {name: file[name][()] for name in SIGNALS if name in file}
            os.utime(path)  # used just now
            return Record(
                **signals,
                true_parameters=run.true_parameters(),
                parameter_names=scenario.parameter_names,
                scenario=run.resolved(),
                hash=scenario.hash,
                seed=seed,
                burn_in=scenario.burn_in,
                versions=made_with(scenario),
            )
        except FileNotFoundError:
            return None
        except (OSError, TypeError, ValueError):
            path.unlink(missing_ok=True)
            return None

    def put(self, scenario: Scenario, record: Record, *, repeat: int = 0) -> None:
        """Keep a record; a full or read-only folder is no error."""
        path = self._path(scenario, record.seed or 0, repeat)
        with suppress(OSError):
            self.folder.mkdir(parents=True, exist_ok=True)
            content = io.BytesIO()  # HDF5 itself would end the process on a full disk
            with h5netcdf.File(content, "w") as file:
                file.dimensions = {"time": len(record.time)}
                for name in SIGNALS:
                    if (values := getattr(record, name)) is not None:
                        file.create_variable(name, ("time",), data=values)
            with atomic(path) as new:
                new.write_bytes(content.getvalue())

    def entries(self) -> list[Path]:
        """Return the files, the least recently used first."""
        found = []
        for path in self.folder.glob("*.nc"):
            with suppress(FileNotFoundError):  # another process may evict at the same time
                found.append((path.stat().st_mtime_ns, path))
        return [path for _, path in sorted(found)]

    def size(self) -> int:
        """Return the size of all entries [bytes]."""
        return sum(path.stat().st_size for path in self.entries())

    def evict(self, limit: int | None = None) -> int:
        """Remove the least recently used entries down to a size [bytes]; return how many."""
        entries, removed = self.entries(), 0
        sizes = [path.stat().st_size for path in entries]
        total = sum(sizes)
        for path, size in zip(entries, sizes, strict=True):
            if total <= (self.limit if limit is None else limit):
                break
            path.unlink(missing_ok=True)
            total, removed = total - size, removed + 1
        return removed

    def clear(self) -> int:
        """Remove all entries; return how many."""
        return self.evict(-1)

    def _path(self, scenario: Scenario, seed: int, repeat: int) -> Path:
        parts = [scenario.record_hash, seed, repeat, sorted(made_with(scenario).items()),
                 digest_of("models_mjcf", "sim")]  # fmt: skip
        return self.folder / f"{sha256(' '.join(map(str, parts)).encode()).hexdigest()}.nc"


def default_cache() -> RecordCache:
    """Return the user's cache: the folder FLEXAXIS_CACHE, else one in the user's cache folder.

    FLEXAXIS_CACHE_LIMIT sets its size in MB (default 2048).

    Raises
    ------
    FlexaxisError
        If the limit is no number.
    """
    from flexaxis.estimators.models.compiler import user_cache

    folder = os.environ.get("FLEXAXIS_CACHE")
    limit = os.environ.get("FLEXAXIS_CACHE_LIMIT", str(LIMIT))
    if not limit.isdigit():
        raise FlexaxisError(f"FLEXAXIS_CACHE_LIMIT is {limit!r}: give a whole number of MB")
    path = Path(folder) if folder else user_cache() / "flexaxis" / "records"
    return RecordCache(path, int(limit) * 1024**2)


def records(
    scenario: Scenario, seeds: Sequence[int], cache: RecordCache | None, *, repeat: int = 0
) -> tuple[list[Record], int]:
    """Return the records of some seeds, and how many of them had to be simulated.

    A kept record is equal to a simulated one to the last bit.
    """
    known: dict[int, Record] = {}
    for seed in seeds if cache else ():
        if cache and (record := cache.get(scenario, seed, repeat=repeat)):
            known[seed] = record
    missing = [seed for seed in seeds if seed not in known]
    made = simulate(scenario, missing, repeat=repeat) if missing else []
    for record in made:
        if cache:
            cache.put(scenario, record, repeat=repeat)
    if cache and made:
        with suppress(FileNotFoundError):  # another process evicts, too
            cache.evict()
    known |= dict(zip(missing, made, strict=True))
    return [known[seed] for seed in seeds], len(made)


def keep_nominal_runs(cache: RecordCache | None) -> AbstractContextManager[None]:
    """Keep the nominal runs that are simulated inside, too: each serves many scenarios."""
    return nominal_runs(lambda scenario: records(scenario, [0], cache)[0][0].torque)
