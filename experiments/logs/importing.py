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
from flexaxis.experiments.logs.doubts.nonsense import refuse_nonsense
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
    interval_means,
    prepare,
    unwrapped,
    without_drift,
)
from flexaxis.experiments.logs.reading.log import open_log
from flexaxis.sim.errors import RecordError
from flexaxis.sim.record import Record, load_record

Array = NDArray[np.float64]

ON_RECORDS = ("highpass", "torque_is", "burn_in")  # options for what is imported already
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
    highpass: float | None = None,
    burn_in: float | None = None,
) -> Imported:
    """Read a log, check it and make a record of it.

    Parameters
    ----------
    path : Path
        CSV, MAT, HDF5, NetCDF or parquet, see `reading.reader.open_log`.
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
        told = _told(path, smooth, because, highpass) | _units(raw)
        record = _record(found, burn_in, told)
    except LogError as error:
        raise LogError(f"{path}: {error}") from error
    return Imported(record, examine(Evidence(record, raw, found)))


def _told(path: Path, smooth: bool, because: str, highpass: float | None) -> dict[str, str]:
    """Return what a record keeps of its import."""
    told = {
        "flexaxis": version("flexaxis"),
        "log": path.name,
        "torque": "smooth" if smooth else "held",
        "torque_because": because,
    }
    return told if highpass is None else told | {"highpass": f"{highpass:g}"}


def _units(raw: Raw) -> dict[str, str]:
    """Return what a record keeps of units: that of the torque, and whether the axis is linear."""
    unit = raw.unit.get("torque", "")
    told = {"torque_unit": {"mA": "A", "mV": "V", "%": "1"}.get(unit, unit)} if unit else {}
    return told | ({"motion": "linear"} if raw.linear else {})


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

    A record that flexaxis wrote takes burn-in and high-pass, and is no log of columns and units:
    its signals are on an even grid and its torque is a mean over each sample already. What was
    looked at when it was imported is on the page of that import: it has no checks here.

    Raises
    ------
    LogError
        If the log cannot be used, or an option is not for a record.
    RecordError
        If the record cannot be read.
    """
    asked: dict[str, Any] = {name: v for name, v in options.items() if v is not None}
    if is_record(path) or (path.suffix == ".nc" and not (tables or asked)):
        try:
            record = load_record(path)
        except RecordError as error:
            if path.is_file():
                raise RecordError(f"{error} To import it as a log, name its columns") from error
            raise
        try:
            return Imported(_treated(record, dict(tables) | asked), ())
        except LogError as error:
            raise LogError(f"{path}: {error}") from error
    return import_log(path, tables, **options)


def look_again(path: Path, tables: Mapping[str, Any], **options: float | None) -> Imported:
    """Return a record that flexaxis wrote, treated as by `import_any`, and what to doubt of it.

    What only its log told (jitter, clipping, wrapping) is on the page of its import.

    Raises
    ------
    LogError, RecordError
        As from `import_any`.
    """
    record = import_any(path, tables, **options).record
    return Imported(record, examine(Evidence(record)))


def read_any(path: Path, tables: Mapping[str, Any], **options: float | None) -> Record:
    """Return a record as `import_any` does, without what was looked at."""
    return import_any(path, tables, **options).record


def _treated(record: Record, asked: Mapping[str, Any]) -> Record:
    """Return a record with what can still be done to it: high-pass, kind of torque, burn-in."""
    wrong = [name for name in asked if name not in ON_RECORDS]
    if wrong:
        words = ", ".join(f"--{name.replace('_', '-')}" for name in wrong)
        raise LogError(
            f"is a record that flexaxis wrote, with signals in SI on an even grid; {words} "
            f"{'is' if len(wrong) == 1 else 'are'} for logs (and so in --map). Leave it out, or "
            f"{_log_of(record)}"
        )
    before = record.versions.get("highpass")
    if "highpass" in asked and before is not None:
        if float(before) != asked["highpass"]:
            raise LogError(
                f"--highpass {asked['highpass']:g} Hz: the record has passed one of {before} Hz "
                "already; import the log again with another"
            )
        asked = {name: value for name, value in asked.items() if name != "highpass"}
    if "burn_in" in asked:
        _check_burn_in(asked["burn_in"], len(record.time) * record.period)
        record = replace(record, burn_in=asked["burn_in"])
    return _as_imported(record, asked)


def _as_imported(record: Record, asked: Mapping[str, Any]) -> Record:
    """Return a record as the import would have made it with these options."""
    kind = record.versions.get("torque", "held")
    wanted = asked.get("torque_is", kind)
    changed: dict[str, Any] = {}
    told = dict(record.versions)
    if wanted != kind:
        if wanted != "smooth" or "highpass" in told:
            raise LogError(
                f"the record holds the means of a {kind} torque; import the log again with "
                f"--torque-is {wanted}"
            )
        time = record.time
        changed["torque"] = interval_means(time, record.torque, time, record.period, smooth=True)
        told |= {"torque": "smooth", "torque_because": GIVEN}
    if "highpass" in asked:
        names = ("torque", "angle", "speed", "increment", "true_angle_a")
        signals = {name: changed.get(name, getattr(record, name)) for name in names}
        there = {name: values for name, values in signals.items() if values is not None}
        changed = without_drift(there, asked["highpass"], record.period)
        told["highpass"] = f"{asked['highpass']:g}"
    return replace(record, **changed, versions=told)


def _log_of(record: Record) -> str:
    """Return what to do to have the log of a record."""
    log = record.versions.get("log")
    if log is None:
        return "simulate it as a log: flexaxis simulate … --as-log csv"
    return f"import the log {log!r} again with it"


def _check_burn_in(burn_in: float, seconds: float) -> None:
    if not 0 <= burn_in < 0.9 * seconds:
        raise LogError(
            f"--burn-in {burn_in:g} s: give 0 or more, and less than nine tenths of the log, "
            f"{seconds:.4g} s"
        )
