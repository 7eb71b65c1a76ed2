"""Check the sampling and the units of a log, and the relation between torque and motion."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from scipy.ndimage import median_filter

from flexaxis.experiments.logs.axis_file import output_of, valid_of
from flexaxis.experiments.logs.findings import Finding, LogError
from flexaxis.experiments.logs.mapping import Raw
from flexaxis.experiments.logs.signals import LONGEST, Array, Flags, gaps_of, rhythm
from flexaxis.experiments.logs.spectra import spectra
from flexaxis.experiments.logs.units import SI
from flexaxis.sim.record import Record

Row = tuple[Any, ...]
"""Severity and text of a finding, and possibly an option that solves the problem."""

FASTEST = 1e4  # maximum plausible motor speed [rad/s]; even milling spindles are slower
MISSING, CLIPPED = 20.0, 1.0  # maximum percentages of missing and clipped samples of a usable log
ROUNDED = 5.0  # minimum percentage of single missing samples that suggests rounded time stamps
WRAPS = 0.35  # maximum turns per sample of a usable log; above 0.5 the direction is ambiguous
LEVELS = 3  # maximum number of levels of a switched torque
SECONDS = 0.02  # sampling period [s] above which its unit may be ms, because 0.02 ms is 50 kHz
WINDOW, USUAL = 7, 95.0  # window length in samples (at most 3 outliers); percentile of usual values
FAR, STEPS = 10.0, 5.0  # factors on the usual distance from the median and on the usual move
JITTER = 0.07  # minimum scatter of the time steps that is reported, in sampling periods
SAME = 0.15  # maximum relative difference between a measured ratio and the factor of a unit
STANDS = 0.5  # minimum fraction of samples of a held torque that equal the previous sample
LOWEST = 0.1  # fraction of the power of the torque that counts as low-frequency
RATIOS = {"speed=rpm": 9.55, "speed=deg/s": 57.3, "speed=rev/s": 0.159, "angle=deg": 0.01745}
"""Ratio of the speed to the slope of the angle, keyed by the unit that is mistaken for SI."""
OTHERS = {"time": "ms or us", "angle": "deg, rev or mm", "speed": "rpm, deg/s or mm/s"}
"""Common units of each signal, other than the unit that flexaxis assumes."""
_MEASURED = re.compile(r"meas|actual|\bact\b|_act|current|_ad|feedback|\bi_?q\b|effort", re.I)
_COMMAND = re.compile(r"ref|cmd|command|set|desired|demand|target", re.I)


def examine(raw: Raw, record: Record) -> tuple[Finding, ...]:
    """Return the findings of all checks of a log, after `refuse_nonsense` has checked the units.

    If the motion has outliers, the signs of torque and motion are not checked, because outliers
    hide the relation between torque and motion.

    Parameters
    ----------
    raw : Raw
        Signals of the log at the logged sampling times.
    record : Record
        Evenly sampled record of the log.
    """
    refuse_nonsense(raw, record)
    motion = raw.signals[raw.motion]
    known = np.isfinite(motion)
    times = raw.time[known][outliers(motion[known])]
    torque = "the torque is {torque} between samples ({torque_because})".format(**record.versions)
    if "V" in raw.unit.get("torque", ""):
        torque += ". The torque column contains a voltage, so f_m includes damping by back-EMF"
    rows = {
        "time stamps": time_stamps(raw, record),
        "wrapping of the angle": wrapping(raw),
        "clipping of the torque": clipping(raw.signals["torque"]),
        "clocks": clocks(raw, record.period),
        "units": units(raw, record.period),
        "torque between samples": ("info", torque),
        "outliers of the motion": outlying(raw.motion, times),
        "signs of torque and motion": None if len(times) else sign(record),
    }
    return tuple(Finding(row[0], row[1], name, *row[2:]) for name, row in rows.items() if row)


def time_stamps(raw: Raw, record: Record) -> Row:
    """Return a finding on the sampling rate, uneven time stamps and missing samples."""
    valid, rate = valid_of(record), 1 / record.period
    missing, gaps = 100 * np.mean(~valid), np.diff(gaps_of(valid))
    steps = np.diff(raw.time) / np.median(np.diff(raw.time))
    texts = [f"{rate:.6g} Hz, {len(valid)} samples, {len(valid) / rate:.4g} s"]
    if len(gaps):
        texts.append(
            f"{missing:.2g} % of the samples are missing (number of gaps: {len(gaps)}, longest "
            f"gap: {gaps.max() / rate:.3g} s); samples in gaps are ignored"
        )
    # an increment also needs the sample before, so a missing row is a gap of two samples
    if np.std(steps - np.rint(steps)) > JITTER or (missing >= ROUNDED and gaps.max() <= 2):
        even = (len(raw.time) - 1) / np.ptp(raw.time)
        texts.append(
            "the time stamps are uneven; if the samples are in fact evenly spaced and no row is "
            f"missing, use --rate {even:.5g} instead of the time column"
        )
    kind = "problem" if missing >= MISSING else "note" if texts[1:] else "ok"
    return kind, "; ".join(texts)


def wrapping(raw: Raw) -> Row | None:
    """Return a finding if the angle was unwrapped, or if it moves too fast to be unwrapped."""
    if not raw.turn:
        return None
    fastest = np.nanmax(abs(np.diff(raw.signals["angle"]))) / raw.turn
    if fastest < WRAPS:
        return "info", f"the angle wraps every {raw.turn:.6g} rad, so flexaxis unwrapped the angle"
    text = (
        f"the angle moves by up to {fastest:.2g} turns per sample. If an angle moves by more than "
        "half a turn per sample, its direction is ambiguous. Log the angle without wrapping or at "
        "a higher rate, or use the speed"
    )
    return "problem", text, "--speed COLUMN instead of --angle"


def clipping(u: Array) -> Row:
    """Return a finding that states whether the torque u (N,) stays at a limit for some samples."""
    u = u[np.isfinite(u)]
    limit = (u == u.max()) | (u == u.min())
    share = 100 * np.mean(limit[2:] & limit[1:-1] & limit[:-2])
    if not share or len(np.unique(u)) <= LEVELS:
        return "ok", "the torque is not clipped"
    text = (
        f"the torque is at its limit of {np.abs(u).max():.4g} for {share:.2g} % of the "
        "time. This limit is harmless if the logged torque really acted on the axis. If the log "
        "contains a command or a saturated sensor signal, log the real torque, or reduce the "
        "excitation"
    )
    return "note" if share < CLIPPED else "problem", text


def clocks(raw: Raw, period: float) -> Row:
    """Return a finding on signals whose samples are repeated or interpolated between updates."""
    if raw.every > 1:
        text = f"torque and {raw.motion} were interpolated, so flexaxis uses only one of every "
        return "note", text + f"{raw.every} rows"
    every = {name: rhythm(raw.signals[name]) for name in ("torque", raw.motion)}
    # a torque that is held for several samples is harmless
    slow = {n: k for n, (k, _, lines) in every.items() if k > 1 and (lines or n != "torque")}
    if not slow:
        return "ok", "torque and motion are updated at every sample"
    n = max(slow.values())
    text = (
        f"only one of every {n} samples of {' and '.join(slow)} is new, and the other samples are "
        "repeated or interpolated. Log torque and motion with the same clock, or reduce the "
        "sampling rate"
    )
    return "problem", text, f"--resample {1 / period / n:.6g}"


def units(raw: Raw, period: float) -> Row:
    """Return a finding on the units that flexaxis had to assume."""
    doubtful = {*raw.signals, *["time"] * (period >= SECONDS)} - raw.unit.keys()
    assumed = [name for name in OTHERS if name in doubtful]
    if not assumed:
        return "ok", "the log or the options state all units"
    taken = " and ".join(f"the {name} is in {SI[name]} (not {OTHERS[name]})" for name in assumed)
    text = (
        f"the log does not state all units, so flexaxis assumes that {taken}. A wrong unit scales "
        "all estimates, and no other check can detect this error. Give the true unit"
    )
    return "note", text, " ".join(f"--unit {name}=UNIT" for name in assumed)


def refuse_nonsense(raw: Raw, record: Record) -> None:
    """Raise a LogError if the unit of a signal is implausible.

    A unit that the file or an option states is rejected only if the ratio of the speed to the slope
    of the angle contradicts it.
    """
    if 355 < raw.turn < 365 and "angle" not in raw.unit:
        raise LogError(
            "the angle jumps by 360 between samples, so it is probably a wrapped angle in degrees. "
            "Give --unit angle=deg if the angle is in degrees, or --unit angle=rad if it is in "
            "radians"
        )
    ok, motion = valid_of(record), raw.motion
    if record.increment is not None and record.speed is not None:
        slope, speed = record.increment[ok], record.speed[ok]
        ratio = abs(slope @ speed / (slope @ slope))
        for unit, usual in RATIOS.items():
            if abs(ratio / usual - 1) < SAME:
                raise LogError(
                    f"the speed is {ratio:.3g} times the slope of the angle, so the unit of one of "
                    f"these two signals is wrong. Give --unit {unit}, or correct the unit of the "
                    "other signal"
                )
    fast = np.percentile(abs(output_of(record)[1][ok]), USUAL)
    if fast > FASTEST and motion not in raw.unit:
        raise LogError(
            f"in the assumed units, the motor would turn implausibly fast, at {fast:.3g} rad/s. Is "
            f"the {motion} in {OTHERS[motion]}, or in counts? Give --unit {motion}=UNIT or "
            f"--scale {motion}=FACTOR. If the unit of the time is wrong, give --unit time=UNIT. If "
            f"the motor really turns this fast, give --unit {motion}={SI[motion]}"
        )


def outlying(name: str, times: Array) -> Row:
    """Return a finding on outliers in the motion at the given times [s]."""
    if not len(times):
        return "ok", "the motion has no outliers"
    at = ", ".join(f"{t:.6g}" for t in times[:4]) + " …" * (len(times) > 4)
    text = (
        f"the {name} jumps and returns within a few samples at {at} s ({len(times)} outliers). No "
        "axis can move in this way, and such outliers spoil all estimates. Empty the cells that "
        "contain outliers; empty cells are ignored. If an encoder counter wraps at these times, "
        "give --counts N"
    )
    return "problem", text


def outliers(x: Array) -> Flags:
    """Return a mask (N,) of outliers: runs of at most three samples far from their neighbours.

    A Hampel filter computes the distance of each sample from the median of seven samples. It
    compares this distance with the 95th percentile of all distances. In a signal without noise, the
    distance is 0 while the motion keeps its direction, and small when the motion reverses.
    Therefore the distance of an outlier must also exceed five times the 95th percentile of the
    changes from one sample to the next.

    Examples
    --------
    >>> motion = np.sin(np.arange(1000) / 20)
    >>> motion[500] = 1e6
    >>> np.flatnonzero(outliers(motion)).tolist()
    [500]
    """
    distance, moves = abs(x - median_filter(x, WINDOW, mode="nearest")), abs(np.diff(x))
    # an axis may rest most of the time, so samples without a move are ignored
    step = np.percentile(moves[moves > 0], USUAL)
    return distance > max(FAR * np.percentile(distance, USUAL), STEPS * step)


def sign(record: Record) -> Row:
    """Return a finding that states whether torque and motion have opposite signs.

    At the lowest excited frequencies, an axis behaves like an inertia with friction. Therefore the
    acceleration leads the torque by 0 to 90°. Moreover, the mean power of the torque is positive,
    because friction can only dissipate power.
    """
    ok, T, u, (output, speed) = valid_of(record), record.period, record.torque, output_of(record)
    s = spectra(u[ok], speed[ok], T)
    low = np.cumsum(s.torque) - s.torque < LOWEST * s.torque.sum()
    faster = s.torque * s.gain * (np.exp(1j * s.omega * T) - 1)
    along = (faster[low] * np.exp(-0.25j * np.pi)).sum().real
    # torque k acts on [t_k, t_{k+1}), so its power is computed from the mean speed in that interval
    moving = speed[1:] if output == "increment" else speed[1:] + speed[:-1]
    if along >= 0 or (u[:-1] * moving)[ok[:-1]].sum() >= 0:
        return "ok", "torque and motion have consistent signs"
    text = "torque and motion have opposite signs. Reverse the sign of one of these signals"
    return "problem", text, "--scale torque=-1"


def torque_kind(raw: Raw, stated: str | None, column: str) -> tuple[str, str]:
    """Return whether a torque is held or smooth between samples, and the reason for this choice.

    A command jumps at each sample and is constant until the next sample. A measured current also
    changes between samples. If a command is treated as smooth, or a current as held, the estimated
    delay has an error of half a sample.
    """
    u = raw.signals["torque"][:LONGEST]
    if stated is not None:
        return stated, "as stated"
    if len(np.unique(u)) <= LEVELS or np.mean(np.diff(u) == 0) > STANDS:
        return "held", "because the log repeats values"
    measured = _MEASURED.search(column) and not _COMMAND.search(column)
    kind, other = ("smooth", "held") if measured else ("held", "smooth")
    return kind, (
        f"assumed from the column name {column}, because a command is held and a measured current "
        f"is smooth; a wrong assumption causes a delay error of half a sample, so give --torque-is "
        f"{other} if the assumption is wrong"
    )
