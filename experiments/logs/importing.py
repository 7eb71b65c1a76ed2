"""From a log in any of the formats to a record, with the findings of its checks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.logs.checks import Evidence, examine, refuse_nonsense, torque_kind
from flexaxis.experiments.logs.findings import Finding, LogError
from flexaxis.experiments.logs.mapping import mapping_from, pick
from flexaxis.experiments.logs.prepare import Prepared, on_clock, prepare, without_interpolation
from flexaxis.experiments.logs.read import open_log
from flexaxis.sim.record import Record, load_record

BURN_IN = 1.0  # s, where a log starts in the middle of a motion
RESTING = 0.05  # of the deviation of the motion, below which a log starts at rest


@dataclass(frozen=True)
class Imported:
    """A record and the findings of the checks of its log."""

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
        CSV, MAT or HDF5, see `read.open_log`.
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
    mapping = mapping_from(tables, source=str(path))
    try:
        raw, stamps = on_clock(pick(open_log(path, mapping.header), mapping))
        refuse_nonsense(raw)
        raw, lines = without_interpolation(raw)
        kind, because = torque_kind(raw, mapping.torque_is, mapping.torque or "torque")
        grid = prepare(raw, smooth=kind == "smooth", resample=resample)
        unit = "Nm" if raw.scaled else raw.unit.get("torque", "")
        about = {
            "flexaxis": version("flexaxis"),
            "log": path.name,
            "torque": kind,
            "torque_because": because,
            "torque_unit": {"mA": "A", "mV": "V", "%": "1"}.get(unit, unit),
            "motion": "linear" if raw.linear else "rotary",
        }
        record = _record(grid, burn_in, {key: text for key, text in about.items() if text})
    except LogError as error:
        where = "" if str(error).startswith(str(path)) else f"{path}: "
        raise LogError(f"{where}{error}") from error
    remarks = "; ".join(filter(None, (stamps, lines)))
    return Imported(record, examine(Evidence(raw, grid, record, remarks)))


def _record(grid: Prepared, burn_in: float | None, about: dict[str, str]) -> Record:
    signals, valid, increment = grid.signals, grid.valid, None
    if "angle" in signals:
        increment = np.diff(signals["angle"], prepend=signals["angle"][0]) / grid.period
        valid = valid & np.r_[True, valid[:-1]]  # an increment needs both of its ends
    moving = signals["speed"] if increment is None else increment
    if not (valid.any() and np.ptp(signals["torque"][valid]) and np.ptp(moving[valid])):
        raise LogError("torque or motion are constant where both are known: nothing can be learnt")
    record = Record(
        time=grid.time,
        torque=signals["torque"],
        angle=signals.get("angle"),
        speed=signals.get("speed"),
        increment=increment,
        valid=None if valid.all() else valid,
        versions=about,
    )
    if burn_in is None:
        resting = np.max(abs(moving[:5])) < RESTING * np.std(moving)
        burn_in = 0.0 if resting else min(BURN_IN, 0.1 * len(moving) * grid.period)
    return _with_burn_in(record, burn_in)


def _with_burn_in(record: Record, burn_in: float) -> Record:
    seconds = len(record.time) * record.period
    if not 0 <= burn_in < 0.9 * seconds:
        raise LogError(
            f"--burn-in {burn_in:g} s: give 0 or more, and less than nine tenths of the log, "
            f"{seconds:.4g} s"
        )
    return replace(record, burn_in=burn_in)


def import_any(
    path: Path, *, resample: float | None = None, burn_in: float | None = None, **tables: Any
) -> Imported:
    """Return a record from a record file, or import a log with the options of `import_log`.

    A record that flexaxis wrote takes a burn-in, and has no columns and units to choose. It has
    no checks here: they are on the page of its import.

    Raises
    ------
    LogError
        If the log cannot be used, or an option is not for a record.
    RecordError
        If the record cannot be read.
    """
    if not is_record(path):
        return import_log(path, tables, resample=resample, burn_in=burn_in)
    record = load_record(path)
    if wrong := [name.replace("_", "-") for name in (*tables, *["resample"] * bool(resample))]:
        log = record.versions.get("log", "its log")
        raise LogError(
            f"{path}: is a record that flexaxis wrote, with signals in SI on an even grid; "
            f"--{', --'.join(wrong)} are for logs: import {log} with them"
        )
    return Imported(record if burn_in is None else _with_burn_in(record, burn_in), ())


def is_record(path: Path) -> bool:
    """Return whether a file is a record that flexaxis wrote."""
    import h5py

    try:
        with h5py.File(path) as file:
            return "versions" in file.attrs
    except (OSError, RuntimeError, ValueError):
        return False
