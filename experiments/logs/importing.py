"""From a log in any of the formats to a record, with a report on what it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.doubts.doubt import Doubt
from flexaxis.experiments.logs.doubts.evidence import of_record
from flexaxis.experiments.logs.doubts.looking import examine
from flexaxis.experiments.logs.doubts.nonsense import refuse_nonsense
from flexaxis.experiments.logs.doubts.torque_kind import (
    AGAINST,
    GIVEN,
    kind_seen,
    torque_kind,
)
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.mapping import LogMap, Raw, mapping_from, pick
from flexaxis.experiments.logs.prepare import FEWEST, Prepared, check_time, prepare, unwrapped
from flexaxis.experiments.logs.reading.reader import open_log
from flexaxis.sim.errors import RecordError
from flexaxis.sim.record import Record, load_record

Array = NDArray[np.float64]

BURN_IN = 1.0  # s, where a log starts in the middle of a motion


@dataclass(frozen=True)
class Imported:
    """A record and what was looked at on the way."""

    record: Record
    checks: tuple[Doubt, ...]


def import_log(
    path: Path,
    tables: Mapping[str, Any],
    *,
    resample: float | None = None,
    highpass: float | None = None,
    burn_in: float | None = None,
) -> Imported:
    """Read a log, check it and make a record of it.

    Parameters
    ----------
    path : Path
        CSV, MAT, HDF5, NetCDF, parquet or a bag, see `reading.reader.open_log`.
    tables : mapping
        As for `mapping_from`.
    resample, highpass : float, optional
        As for `prepare` [Hz].
    burn_in : float, optional
        Time from the start that is not to be fitted [s]; by default none for a log that starts
        at rest, as the estimators do, else a second, or a tenth of a short log.

    Raises
    ------
    LogError
        If the log cannot be used; the message begins with its name.
    """
    chosen = mapping_from(tables, source=str(path))
    raw = pick(open_log(path), chosen)
    try:
        check_time(raw.time)
        refuse_nonsense(raw)
        smooth, because = _kind(raw, chosen)
        found = prepare(raw, smooth=smooth, resample=resample, highpass=highpass)
        record = _record(found, burn_in, _told(path, smooth, because, highpass))
    except LogError as error:
        raise LogError(f"{path}: {error}") from error
    return Imported(record, examine(replace(of_record(record), raw=raw, prepared=found)))


def _told(path: Path, smooth: bool, because: str, highpass: float | None) -> dict[str, str]:
    """Return what a record keeps of its import."""
    told = {
        "flexaxis": version("flexaxis"),
        "log": path.name,
        "torque": "smooth" if smooth else "held",
        "torque_because": because,
    }
    return told if highpass is None else told | {"highpass": f"{highpass:g}"}


def _kind(raw: Raw, chosen: LogMap) -> tuple[bool, str]:
    """Return whether the torque is smooth, and why."""
    stated = chosen.smooth
    speed, there = _motion(raw)
    if there.sum() < FEWEST:
        return bool(stated), "too few samples to tell" if stated is None else GIVEN
    signals = raw.torque[there], float(np.median(np.diff(raw.time)))
    if stated is None:
        name = chosen.columns.get("torque", "torque")
        kind, because = torque_kind(*signals, speed=speed[there], name=name)
        return kind == "smooth", because
    seen = kind_seen(*signals, speed=speed[there])
    against = seen is not None and (seen[0] == "smooth") != stated
    return stated, f"{AGAINST} {seen[1]}" if against and seen else GIVEN


def _motion(raw: Raw) -> tuple[Array, NDArray[np.bool_]]:
    """Return the speed at the samples of a log, but for a factor, and where all is there."""
    there = np.isfinite(raw.torque)
    if raw.angle is None:
        assert raw.speed is not None  # a mapping has one of the two
        return raw.speed, there & np.isfinite(raw.speed)
    there &= np.isfinite(raw.angle)
    speed = np.zeros(len(raw.time))
    angle = unwrapped(raw.angle[there])[0] if there.any() else np.zeros(0)
    speed[there] = np.diff(angle, prepend=angle[:1])
    return speed, there


def _record(found: Prepared, burn_in: float | None, told: dict[str, str]) -> Record:
    signals, valid, steps = found.signals, found.valid, None
    if "angle" in signals:
        steps = np.diff(signals["angle"], prepend=signals["angle"][0]) / found.period
        valid = valid & np.r_[True, valid[:-1]]  # an increment needs both of its ends
    moving = signals["speed"] if steps is None else steps
    if burn_in is None:
        resting = np.max(abs(moving[:5])) < 0.05 * np.std(moving)
        burn_in = 0.0 if resting else min(BURN_IN, 0.1 * len(moving) * found.period)
    if not 0 <= burn_in < 0.9 * len(moving) * found.period:
        raise LogError(
            f"--burn-in {burn_in:g} s: give 0 or more, and less than nine tenths of the log, "
            f"{len(moving) * found.period:.4g} s"
        )
    return Record(
        time=found.time,
        torque=signals["torque"],
        angle=signals.get("angle"),
        speed=signals.get("speed"),
        increment=steps,
        true_angle_a=signals.get("load_angle"),
        valid=None if valid.all() else valid,
        burn_in=burn_in,
        versions=told,
    )


def read_any(path: Path, tables: Mapping[str, Any], **options: float | None) -> Record:
    """Return a record from a record file, or import a log with the options of `import_log`."""
    if path.suffix == ".nc" and not tables and not any(v is not None for v in options.values()):
        try:
            return load_record(path)
        except RecordError as error:
            if path.is_file():
                raise RecordError(f"{error} To import it as a log, name its columns") from error
            raise
    return import_log(path, tables, **options).record
