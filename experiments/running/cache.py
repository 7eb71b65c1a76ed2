"""Cache simulated records in NetCDF files; above a size limit, delete the least recently used.

The cache key of a record consists of the scenario hash (`Scenario.record_hash`), the seed, the
MuJoCo version, and a digest of the simulation code and the MJCF model files.
"""

import io
import os
from collections.abc import Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from functools import cache as cached
from hashlib import sha256
from importlib.resources import files
from pathlib import Path

import h5py

from flexaxis.experiments.scoring.nominal_torque import nominal_runs
from flexaxis.sim.record import SIGNALS, Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import made_with, record_of, simulate
from flexaxis.sim.text_files import atomic

LIMIT = 2 * 1024**3  # default size limit of the cache [bytes]
SHORT = 12
"""Number of hexadecimal digits in a digest."""


@dataclass(frozen=True)
class RecordCache:
    """A folder of cached records with a total size of at most `limit` bytes."""

    folder: Path
    limit: int = LIMIT

    def get(self, scenario: Scenario, seed: int) -> Record | None:
        """Return a cached record, or None if its file is missing or damaged.

        The method deletes a damaged file.
        """
        path = self._path(scenario, seed)
        try:
            with h5py.File(path) as file:
                signals = {name: values[()] for name, values in file.items()}
            os.utime(path)  # mark as recently used
            return record_of(scenario, seed, signals)
        except (OSError, TypeError, ValueError):
            path.unlink(missing_ok=True)
            return None

    def put(self, scenario: Scenario, record: Record) -> None:
        """Store a record in the cache; ignore errors due to a full disk or a read-only folder."""
        content = io.BytesIO()  # if HDF5 wrote to a full disk, HDF5 would end the process
        with h5py.File(content, "w") as file:
            for name in [*SIGNALS][1:]:  # without the time, which is computed from the scenario
                if (values := getattr(record, name)) is not None:
                    file[name] = values
        with suppress(OSError):
            self.folder.mkdir(parents=True, exist_ok=True)
            with atomic(self._path(scenario, record.seed or 0)) as new:
                new.write_bytes(content.getvalue())

    def entries(self) -> list[Path]:
        """Return all files in the cache, sorted by the time of last use."""
        return sorted(self.folder.glob("*.nc"), key=lambda path: path.stat().st_mtime_ns)

    def evict(self, limit: int) -> int:
        """Remove the least recently used files until the cache size is at most `limit` bytes.

        The method returns the number of removed files.
        """
        total, removed = 0, 0
        for path in self.entries()[::-1]:
            total += path.stat().st_size
            if total > limit:
                path.unlink(missing_ok=True)
                removed += 1
        return removed

    def _path(self, scenario: Scenario, seed: int) -> Path:
        parts = [scenario.record_hash, seed, sorted(made_with(scenario).items()),
                 digest_of("models_mjcf", "sim")]  # fmt: skip
        return self.folder / f"{sha256(' '.join(map(str, parts)).encode()).hexdigest()}.nc"


def default_cache() -> RecordCache:
    """Return the record cache; the environment variable FLEXAXIS_CACHE can set its folder."""
    from flexaxis.estimators.models.compiler import user_cache

    usual = user_cache() / "flexaxis" / "records"
    return RecordCache(Path(os.environ.get("FLEXAXIS_CACHE") or usual))


def records(scenario: Scenario, seeds: Sequence[int], cache: RecordCache | None) -> list[Record]:
    """Return the records of a scenario for the given seeds; simulate records that are not cached.

    A cached record is bitwise equal to a newly simulated record.
    """
    if cache is None:
        return simulate(scenario, seeds)
    known = {seed: cache.get(scenario, seed) for seed in seeds}
    missing = [seed for seed, record in known.items() if record is None]
    made = simulate(scenario, missing) if missing else []
    for record in made:
        cache.put(scenario, record)
    with suppress(FileNotFoundError):  # another process may evict at the same time
        cache.evict(cache.limit)
    known |= dict(zip(missing, made, strict=True))
    return [record for record in known.values() if record]


def keep_nominal_runs(cache: RecordCache | None) -> AbstractContextManager[None]:
    """Return a context manager that caches nominal runs, so that many scenarios can share them."""
    return nominal_runs(lambda scenario: records(scenario, [0], cache)[0].torque)


@cached
def digest_of(*packages: str) -> str:
    """Return a digest of the code, models and settings in the given packages of flexaxis."""
    content = sha256()
    for package in packages:
        folder = Path(str(files(f"flexaxis.{package}")))
        for path in sorted(folder.rglob("*")):
            if path.suffix in {".py", ".xml", ".toml"}:
                content.update(path.read_bytes())
    return content.hexdigest()[:SHORT]
