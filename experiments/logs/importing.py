"""Convert a log to a record with even sampling, and check the log."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt
from scipy.stats import linregress

from flexaxis.experiments.logs.checks import examine, refuse_nonsense, torque_kind
from flexaxis.experiments.logs.findings import Finding, LogError, checked
from flexaxis.experiments.logs.mapping import LogMap, Raw, pick
from flexaxis.experiments.logs.read import open_log
from flexaxis.experiments.logs.signals import rhythm, unwrapped
from flexaxis.sim.errors import RecordError
from flexaxis.sim.record import Record, load_record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

BURN_IN = 1.0  # s, default burn-in of a log that starts in the middle of a motion
RESTING = 0.05  # maximum initial speed of an axis at rest, relative to the std of the speed
FEWEST = 200  # minimum number of samples
MOST_GAPS = 10  # maximum ratio of samples on the even grid to samples in the log
NEAR = 0.05  # maximum ignored distance of a time stamp from the even grid, in sampling periods
SLOWEST = 1.01  # longest sampling period [s]; spectra are averaged over pieces of four seconds
JITTER = 5.0  # minimum scatter of the time stamps that is reported [% of a sampling period]
WHOLE = 0.02  # maximum relative difference between a new rate and an integer fraction of the rate


@dataclass(frozen=True)
class Imported:
    """A record, and the findings of the checks of the log."""

    record: Record
    checks: tuple[Finding, ...]


def import_log(path: Path, *, burn_in: float | None = None, **tables: Any) -> Imported:
    """Read and check a log and convert it to a record, or load a record that flexaxis wrote.

    For a record, `burn_in` is the only allowed option. A record is not checked again, because the
    page of its import shows the results of the checks.

    Parameters
    ----------
    path : Path
        A CSV, MAT, HDF5 or NetCDF file (see `read.open_log`), or a record.
    burn_in : float, optional
        Length of the initial part that is not fitted [s]. The default is 0 if the log starts at
        rest, else 1 s or a tenth of the log, whichever is shorter.
    **tables
        Options, which are the attributes of `LogMap`.

    Raises
    ------
    LogError
        If the log cannot be used, or if an option does not apply to a record. The message begins
        with the path.
    """
    record = None
    with suppress(RecordError):
        record = load_record(path)
    try:
        if record is None or not record.versions:  # the file is a log, perhaps in HDF5
            result = _imported(path, checked(LogMap, tables, "options"))
        elif tables:
            raise LogError(
                "is a record that flexaxis wrote, with signals in SI units and even sampling. The "
                f"options --{', --'.join(tables).replace('_', '-')} are for logs. Use them to "
                f"import {record.versions.get('log', 'the log')}"
            )
        else:
            result = Imported(record, ())
        record = result.record
        seconds, left_out = len(record.time) * record.period, burn_in or 0.0
        if not 0 <= left_out < 0.9 * seconds:
            raise LogError(
                f"--burn-in {left_out:g} s is not possible. Give at least 0 s and less than nine "
                f"tenths of the length of the log ({seconds:.4g} s)"
            )
    except LogError as error:
        raise LogError(f"{path}: {error}") from error
    left_out = record.burn_in if burn_in is None else burn_in
    return replace(result, record=replace(record, burn_in=left_out))


def _imported(path: Path, mapping: LogMap) -> Imported:
    raw = on_clock(pick(open_log(path, mapping.header), mapping))
    refuse_nonsense(raw)
    raw, lines = without_interpolation(raw)
    kind, because = torque_kind(raw, mapping.torque_is, mapping.torque or "torque")
    record, jitter = _on_grid(raw, smooth=kind == "smooth", rate=mapping.resample)
    scaled = abs(mapping.scale.get("torque", 1.0)) != 1
    unit = "Nm" if scaled else raw.unit.get("torque", "")
    about = {
        "flexaxis": version("flexaxis"), "log": path.name, "torque": kind,
        "torque_because": because, "motion": "linear" if raw.linear else "rotary",
        "torque_unit": {"mA": "A", "mV": "V", "%": "1"}.get(unit, unit),
    }  # fmt: skip
    record = replace(record, versions=about)
    return Imported(record, examine(raw, record, [*filter(None, (lines, jitter))]))


def on_clock(raw: Raw) -> Raw:
    """Return the rows of a log that have a time stamp.

    Raises
    ------
    LogError
        If there are too few samples, or if the time does not increase.
    """
    known = np.isfinite(raw.time)  # a row without time is a gap
    time, signals = raw.time[known], {name: x[known] for name, x in raw.signals.items()}
    for name, values in {"time": time, **signals}.items():
        if (count := int(np.isfinite(values).sum())) < FEWEST:
            raise LogError(f"{name} has {count} samples, but at least {FEWEST} are needed")
    back = np.flatnonzero(np.diff(time) <= 0)
    if len(back):
        k = int(back[0]) + 1
        before, after = time[k - 1] - time[0], time[k] - time[0]
        text = f"at row {k}, the time since the start changes from {before:.9g} s to {after:.9g} s"
        if after < 0.05 * before:
            raise LogError(
                f"{text}: a new log begins there; select one with --rows 0:{k} or --rows {k}:. If "
                "only the clock restarts, give --rate HZ instead of the time column"
            )
        raise LogError(
            f"{text}. The time does not advance at {len(back)} rows. Remove rows that are repeated "
            "or out of order. If the sampling was even, give --rate HZ instead of the time column"
        )
    return replace(raw, time=time, signals=signals)


def without_interpolation(raw: Raw) -> tuple[Raw, str]:
    """Return the original samples of a log, and a remark if the log was interpolated."""
    n, first, lines = rhythm(raw.signals["torque"])
    if not lines or rhythm(raw.signals[raw.motion]) != (n, first, lines):
        return raw, ""
    part = slice(first, None, n)
    signals = {name: values[part] for name, values in raw.signals.items()}
    remark = f"torque and {raw.motion} are interpolated, so only every {n}th row is used"
    return replace(raw, time=raw.time[part], signals=signals), remark


def _on_grid(raw: Raw, *, smooth: bool, rate: float | None) -> tuple[Record, str]:
    """Return the record of a log with even sampling, and a remark on the time stamps of the log.

    Torques are means over [t_k, t_{k+1}). If the rate is reduced, all signals pass through the same
    zero-phase low-pass filter. The torque is then averaged over each new sampling period.
    """
    period, index = _grid(raw.time)
    if period > SLOWEST or (period >= 1 and "time" not in raw.unit):
        raise LogError(
            f"a sampling period of {period:.3g} s is too long for an axis. Is the time in ms, us "
            "or ns? Give the unit, such as --unit time=us. If it is in s, give --unit time=s"
        )
    time = raw.time[0] + period * np.arange(index[-1] + 1.0)
    off = raw.time - time[index]
    stamps = time[index] if np.max(abs(off)) <= NEAR * period else raw.time
    signals, valid = dict[str, Any](), np.isin(np.arange(len(time)), index)
    for name, logged in raw.signals.items():
        known = np.isfinite(logged)
        valid[index[~known]] = False
        values, at = logged[known], stamps[known]
        if name == "angle":
            values = unwrapped(values)[0]
        if name == "torque" and not smooth:  # a held torque acts until the next sample
            at = time[index[known]]
        signals[name] = np.interp(time, at, values)
    if smooth:
        integral = CubicSpline(time, signals["torque"]).antiderivative()(time)
        signals["torque"][:-1] = np.diff(integral) / period
    every = 1 if rate is None else round(1 / (rate * period))
    n = len(time) // max(every, 1)
    if rate is not None:
        if every < 2 or n < FEWEST or abs(every * rate * period - 1) > WHOLE:
            raise LogError(
                f"--resample {rate:g} Hz is not possible. Divide the rate of the log "
                f"({1 / period:.6g} Hz) by an integer that leaves at least {FEWEST} samples"
            )
        lowpass = butter(8, 0.8 / every, output="sos")
        signals = {name: sosfiltfilt(lowpass, values) for name, values in signals.items()}
    signals |= {"time": time, "valid": valid}
    rows = {name: x[: n * every].reshape(n, every) for name, x in signals.items()}
    signals = {name: x[:, 0] for name, x in rows.items()}
    signals |= {"torque": rows["torque"].mean(axis=1), "valid": rows["valid"].all(axis=1)}
    jitter = 100 * np.std(off) / period
    remark = (
        f"the time stamps scatter by {jitter:.0f} % of a period, so signals were interpolated; if "
        f"the sampling was in fact even, use --rate {1 / period:.6g} instead of the time column"
    )
    return _record(**signals), remark if jitter >= JITTER else ""


def _grid(time: Array) -> tuple[float, NDArray[np.int64]]:
    """Return the sampling period [s], and the index of each sample on an even grid."""
    steps = np.diff(time)
    places = np.r_[0, np.cumsum(np.maximum(np.rint(steps / np.median(steps)), 1))]
    # a small error of the median of jittered steps would accumulate, so the period is fitted
    period = float(linregress(places, time).slope)
    index = np.rint((time - time[0]) / period).astype(int)
    if (np.diff(index) <= 0).any() or index[-1] > MOST_GAPS * len(time):
        raise LogError(
            f"the time stamps are too irregular, with steps of {steps.min():.3g} s to "
            f"{steps.max():.3g} s; resample the log first. If the sampling was in fact even, give "
            "--rate HZ instead of the time column"
        )
    return period, index


def _record(time: Array, valid: Flags, torque: Array, **motion: Any) -> Record:
    """Return a record of signals (N,). The motion is an angle, a speed, or both."""
    period, increment = (time[-1] - time[0]) / (len(time) - 1), None
    if "angle" in motion:
        increment = np.diff(motion["angle"], prepend=motion["angle"][0]) / period
        valid = valid & np.r_[True, valid[:-1]]  # an increment is the difference of two samples
    moving = motion["speed"] if increment is None else increment
    if not (valid.any() and np.ptp(torque[valid]) and np.ptp(moving[valid])):
        raise LogError(
            "torque or motion is constant where both are known. Either a column is wrong, or the "
            "axis did not move"
        )
    resting = np.max(abs(moving[:5])) < RESTING * np.std(moving)
    return Record(
        time=time, torque=torque, **motion, increment=increment,
        valid=None if valid.all() else valid,
        burn_in=0.0 if resting else min(BURN_IN, 0.1 * len(time) * period),
    )  # fmt: skip
