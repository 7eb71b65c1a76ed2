"""From a log in any of the formats to a record, with a report on what it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.doubts import examine
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.sampled import refuse_nonsense
from flexaxis.experiments.logs.doubts.torque_kind import (
    AGAINST,
    GIVEN,
    kind_seen,
    torque_kind,
)
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.files import is_record
from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.logs.mapping import LogMap, Raw, mapping_from, pick
from flexaxis.experiments.logs.prepare import (
    FEWEST,
    Prepared,
    check_time,
    prepare,
    unwrapped,
)
from flexaxis.experiments.logs.reading.log import open_log
from flexaxis.sim.errors import RecordError
from flexaxis.sim.record import Record, load_record

Array = NDArray[np.float64]

BURN_IN = 1.0  # s, where a log starts in the middle of a motion


@dataclass(frozen=True)
class Imported:
    """A record and what was looked at on the way."""

    record: Record
    checks: tuple[Finding, ...]


def import_log(
    path: Path,
    tables: Mapping[str, Any],
    *,
    resample: float | None = None,
    burn_in: float | None = None,
) -> Imported:
    """Read a log, check it and make a record of it.

    Parameters
    ----------
    path : Path
        CSV, MAT, HDF5, NetCDF or parquet, see `reading.log.open_log`.
    tables : mapping
        As for `mapping_from`.
    resample : float, optional
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
        found = prepare(raw, smooth=smooth, resample=resample)
        told = {
            "flexaxis": version("flexaxis"),
            "log": path.name,
            "torque": "smooth" if smooth else "held",
            "torque_because": because,
        }
        record = _record(found, burn_in, told | _units(raw))
    except LogError as error:
        raise LogError(f"{path}: {error}") from error
    return Imported(record, examine(Evidence(record, raw, found)))


def _units(raw: Raw) -> dict[str, str]:
    """Return what a record keeps of units: that of the torque, and whether the axis is linear."""
    unit = raw.unit.get("torque", "")
    told = {"torque_unit": {"mA": "A", "mV": "V", "%": "1"}.get(unit, unit)} if unit else {}
    return told | ({"motion": "linear"} if raw.linear else {})


def _kind(raw: Raw, chosen: LogMap) -> tuple[bool, str]:
    """Return whether the torque is smooth, and why."""
    stated, there = chosen.torque_is, np.isfinite(raw.torque)
    values = raw.speed if raw.angle is None else raw.angle
    assert values is not None  # a mapping has one of the two
    there &= np.isfinite(values)
    if there.sum() < FEWEST:
        return stated == "smooth", GIVEN if stated else "too few samples to tell"
    # the speed but for a factor
    speed = values[there] if raw.angle is None else np.diff(unwrapped(values[there])[0])
    signals = raw.torque[there][-len(speed) :], float(np.median(np.diff(raw.time)))
    if stated is None:
        kind, because = torque_kind(*signals, speed=speed, name=chosen.torque or "torque")
        return kind == "smooth", because
    seen = kind_seen(*signals, speed=speed)
    against = seen is not None and seen[0] != stated
    return stated == "smooth", f"{AGAINST} {seen[1]}" if against and seen else GIVEN


def _record(found: Prepared, burn_in: float | None, told: dict[str, str]) -> Record:
    signals, valid, steps = found.signals, found.valid, None
    if "angle" in signals:
        steps = np.diff(signals["angle"], prepend=signals["angle"][0]) / found.period
        valid = valid & np.r_[True, valid[:-1]]  # an increment needs both of its ends
    moving = signals["speed"] if steps is None else steps
    if not (valid.any() and np.ptp(signals["torque"][valid]) and np.ptp(moving[valid])):
        raise LogError("torque or motion are constant where both are there: nothing can be learnt")
    if burn_in is None:
        resting = np.max(abs(moving[:5])) < 0.05 * np.std(moving)
        burn_in = 0.0 if resting else min(BURN_IN, 0.1 * len(moving) * found.period)
    _check_burn_in(burn_in, len(moving) * found.period)
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


def import_any(path: Path, tables: Mapping[str, Any], **options: float | None) -> Imported:
    """Return a record from a record file, or import a log with the options of `import_log`.

    A record that flexaxis wrote takes a burn-in, and is no log of columns and units. What was
    looked at when it was imported is on the page of that import: it has no checks here.

    Raises
    ------
    LogError
        If the log cannot be used, or an option is not for a record.
    RecordError
        If the record cannot be read.
    """
    asked: dict[str, Any] = {name: v for name, v in options.items() if v is not None}
    if not is_record(path) and (path.suffix != ".nc" or tables or asked):
        return import_log(path, tables, **options)
    try:
        record = load_record(path)
    except RecordError as error:
        if path.is_file():
            raise RecordError(f"{error} To import it as a log, name its columns") from error
        raise
    known = {"burn_in": asked.get("burn_in"), "torque_is": record.versions.get("torque", "held")}
    every = {**tables, **asked}.items()
    if wrong := [name.replace("_", "-") for name, x in every if known.get(name) != x]:
        log = record.versions.get("log", "one of `flexaxis simulate … --as-log csv`")
        raise LogError(
            f"{path}: is a record that flexaxis wrote, with signals in SI on an even grid; "
            f"--{', --'.join(wrong)} (and --map) are for logs: import {log} with them"
        )
    if "burn_in" in asked:
        _check_burn_in(asked["burn_in"], len(record.time) * record.period, f"{path}: ")
    return Imported(replace(record, burn_in=asked.get("burn_in", record.burn_in)), ())


def read_any(path: Path, tables: Mapping[str, Any], **options: float | None) -> Record:
    """Return a record as `import_any` does, without what was looked at."""
    return import_any(path, tables, **options).record


def _check_burn_in(burn_in: float, seconds: float, where: str = "") -> None:
    if not 0 <= burn_in < 0.9 * seconds:
        raise LogError(
            f"{where}--burn-in {burn_in:g} s: give 0 or more, and less than nine tenths of the "
            f"log, {seconds:.4g} s"
        )
