"""Convert a log to an evenly sampled record, and check the log."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt
from scipy.stats import linregress

from flexaxis.experiments.logs.checks import examine, torque_kind
from flexaxis.experiments.logs.findings import Finding, LogError, checked
from flexaxis.experiments.logs.mapping import LogMap, Raw, pick
from flexaxis.experiments.logs.read import open_log
from flexaxis.experiments.logs.signals import Array, Flags, rhythm, unwrapped
from flexaxis.sim.errors import RecordError
from flexaxis.sim.record import Record, load_record

BURN_IN = 1.0  # s, default burn-in of a log that starts in the middle of a motion
RESTING = 0.05  # maximum initial speed of an axis at rest, relative to the std of the speed
FEWEST = 200  # minimum number of samples
MOST_GAPS = 10  # maximum ratio of samples on the even grid to samples in the log
NEAR = 0.05  # maximum ignored distance of a time stamp from the even grid, in sampling periods
SLOWEST = 0.99  # longest sampling period [s]; spectra are averaged over segments of four seconds
WHOLE = 0.02  # maximum relative difference between a new rate and an integer fraction of the rate


class Imported(NamedTuple):
    """The record of a log, and the findings of all checks of this log."""

    record: Record
    checks: tuple[Finding, ...]


def import_log(path: Path, *, burn_in: float | None = None, **tables: Any) -> Imported:
    """Read and check a log and convert it to a record, or load a record that flexaxis wrote.

    For a record, `burn_in` is the only allowed option. A record is not checked again, because
    flexaxis checked the log when it wrote the record.

    Parameters
    ----------
    path : Path
        A CSV, MAT, HDF5 or NetCDF file (see `read.open_log`), or a record.
    burn_in : float, optional
        Time at the start of the log that is not fitted [s]. The default is 0 if the log starts at
        rest, else 1 s or a tenth of the log, whichever is shorter.
    **tables
        Options for reading the log, which are the attributes of `LogMap`.

    Raises
    ------
    LogError
        If the log cannot be used, or if an option does not apply to a record. The error message
        begins with the path of the log.
    """
    record = None
    checks: tuple[Finding, ...] = ()
    with suppress(RecordError):
        record = load_record(path)
    try:
        if record is None or not record.versions:  # the file is a log, perhaps in HDF5
            record, checks = _imported(path, checked(LogMap, tables, "options"))
        elif tables:
            raise LogError(
                "is a record that flexaxis wrote, with evenly sampled signals in SI units. The "
                f"options --{', --'.join(tables).replace('_', '-')} apply only to logs. Use these "
                f"options when you import {record.versions.get('log', 'the log')}"
            )
        seconds = len(record.time) * record.period
        left_out = record.burn_in if burn_in is None else burn_in
        if not 0 <= left_out < 0.9 * seconds:
            raise LogError(
                f"--burn-in {left_out:g} s is not possible. Give at least 0 s, and less than nine "
                f"tenths of the log, which is {seconds:.4g} s long"
            )
    except LogError as error:
        raise LogError(f"{path}: {error}") from error
    return Imported(replace(record, burn_in=left_out), checks)


def _imported(path: Path, mapping: LogMap) -> Imported:
    raw = cleaned(pick(open_log(path, mapping.header), mapping))
    kind, because = torque_kind(raw, mapping.torque_is, mapping.torque or "torque")
    record = _record(*_on_grid(raw, kind == "smooth"), mapping.resample)
    unit = raw.unit.get("torque", "")
    if abs(mapping.scale.get("torque", 1.0)) != 1:
        unit = "Nm"
    about = {
        "flexaxis": version("flexaxis"), "log": path.name, "torque": kind,
        "torque_because": because, "motion": "linear" if raw.linear else "rotary",
        "torque_unit": {"mA": "A", "mV": "V", "%": "1"}.get(unit, unit),
    }  # fmt: skip
    record = replace(record, versions=about)
    return Imported(record, examine(raw, record))


def cleaned(raw: Raw) -> Raw:
    """Return the original samples of a log, with an unwrapped angle.

    Rows without a time stamp are omitted. If torque and motion were interpolated to a faster grid,
    only the rows with original samples are returned.

    Raises
    ------
    LogError
        If there are too few samples, or if the time does not increase.
    """
    raw = raw.part(np.isfinite(raw.time))
    for name, values in {"time": raw.time, **raw.signals}.items():
        if (count := np.isfinite(values).sum()) < FEWEST:
            raise LogError(f"{name} has {count} samples, but a log needs at least {FEWEST}")
    back = np.flatnonzero(np.diff(raw.time) <= 0) + 1
    if len(back):
        before, after = raw.time[back[0] - 1 : back[0] + 1] - raw.time[0]
        raise LogError(
            f"the time does not advance at {len(back)} rows. The first is row {back[0]}, at which "
            f"the time since the start changes from {before:.9g} s to {after:.9g} s. If a new log "
            f"begins at row {back[0]}, select one log with --rows 0:{back[0]} or --rows "
            f"{back[0]}:. If not, remove rows that are repeated or out of order. If the samples "
            "are evenly spaced, you can give --rate HZ instead of the time column"
        )
    n, first, lines = updates = rhythm(raw.signals["torque"])
    if lines and updates == rhythm(raw.signals[raw.motion]):
        raw = raw.part(slice(first, None, n))._replace(every=n)
    if raw.motion == "angle":
        angle = raw.signals["angle"]
        known = np.isfinite(angle)
        angle[known], turn = unwrapped(angle[known])
        raw = raw._replace(turn=turn)
    return raw


def _on_grid(raw: Raw, smooth: bool) -> tuple[Array, dict[str, Array], Flags]:
    """Return a uniform time grid (N,), the signals on it, and a mask (N,) of the known samples.

    The torque of sample k is the mean over the interval [t_k, t_{k+1}).
    """
    steps = np.diff(raw.time)
    places = np.r_[0, np.cumsum(np.maximum(np.rint(steps / np.median(steps)), 1))]
    # a small error of the median of jittered steps would accumulate, so the period is fitted
    period = linregress(places, raw.time).slope
    index = np.rint((raw.time - raw.time[0]) / period).astype(int)
    if (np.diff(index) <= 0).any() or index[-1] > MOST_GAPS * len(index):
        raise LogError(
            f"the time stamps are too irregular, with steps of {steps.min():.3g} s to "
            f"{steps.max():.3g} s. Resample the log first. If the samples are in fact evenly "
            "spaced, give --rate HZ instead of the time column"
        )
    if period > SLOWEST:
        raise LogError(
            f"a sampling period of {period:.3g} s is too long for an axis. If the time is in ms, "
            "us or ns, give the unit, for example --unit time=us"
        )
    time = raw.time[0] + period * np.arange(index[-1] + 1.0)
    near = np.max(abs(raw.time - time[index])) <= NEAR * period
    signals, valid = dict[str, Array](), np.isin(np.arange(len(time)), index)
    for name, values in raw.signals.items():
        known = np.isfinite(values)
        valid[index[~known]] = False
        # a held torque acts until the next sample
        held = name == "torque" and not smooth
        stamps = time[index] if near or held else raw.time
        signals[name] = np.interp(time, stamps[known], values[known])
    if smooth:
        integral = CubicSpline(time, signals["torque"]).antiderivative()(time)
        signals["torque"][:-1] = np.diff(integral) / period
    return time, signals, valid


def _record(time: Array, signals: dict[str, Array], valid: Flags, rate: float | None) -> Record:
    """Return the record of evenly sampled signals.

    If `rate` [Hz] is given, the sampling rate is reduced to `rate`. All signals then pass through
    the same zero-phase low-pass filter, and the torque is averaged over each new sampling period.
    """
    period = float(np.ptp(time)) / (len(time) - 1)
    rate = rate or 1 / period
    every = round(1 / (rate * period))
    if abs(every * rate * period - 1) > WHOLE or len(time) // every < FEWEST:
        raise LogError(
            f"--resample {rate:g} Hz is not possible. Give the rate of the log "
            f"({1 / period:.6g} Hz) divided by an integer that leaves at least {FEWEST} samples"
        )
    if every > 1:
        lowpass = butter(8, 0.8 / every, output="sos")
        signals = {name: sosfiltfilt(lowpass, values) for name, values in signals.items()}
    rows = np.arange(len(time) // every * every).reshape(-1, every)
    first: dict[str, Any] = {name: values[rows[:, 0]] for name, values in signals.items()}
    first["torque"] = torque = signals["torque"][rows].mean(axis=1)
    valid, period = np.all(valid[rows], axis=1), every * period
    if "angle" in first:
        first["increment"] = np.diff(first["angle"], prepend=first["angle"][0]) / period
        valid = valid & np.r_[True, valid[:-1]]  # an increment is the difference of two samples
    moving = first["increment" if "angle" in first else "speed"]
    if not (valid.any() and np.ptp(torque[valid]) and np.ptp(moving[valid])):
        raise LogError(
            "torque or motion is constant in all rows that contain both signals. Either a column "
            "is wrong, or the axis did not move"
        )
    resting = np.max(abs(moving[:5])) < RESTING * np.std(moving)
    burn_in = 0.0 if resting else min(BURN_IN, 0.1 * len(moving) * period)
    known = None if valid.all() else valid
    return Record(time=time[rows[:, 0]], valid=known, burn_in=burn_in, **first)
