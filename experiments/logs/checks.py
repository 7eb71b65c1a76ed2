"""Checks of a log: its sampling, its units, and the relation of torque and motion."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from flexaxis.experiments.logs.axis_file import output_of, valid_of
from flexaxis.experiments.logs.findings import Finding, Kind, LogError
from flexaxis.experiments.logs.mapping import Raw
from flexaxis.experiments.logs.signals import LONGEST, gaps_of, resolution, rhythm, unwrapped
from flexaxis.experiments.logs.spectra import spectra
from flexaxis.experiments.logs.units import SI
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Row = tuple[Kind, str] | tuple[Kind, str, str]
"""Kind and text of a finding, and the option to type."""

FASTEST = 1e4  # rad/s, maximum plausible motor speed; milling spindles are slower
MISSING, CLIPPED = 20.0, 1.0  # % of the samples that are missing, or clipped: limits of a problem
ROUNDED = 5.0  # % of the samples that are missing one by one: the stamps may be rounded
WRAPS = 0.35  # turns per sample, limit of a problem; above 0.5 the direction is ambiguous
LEVELS = 3  # maximum number of levels of a switched torque
SECONDS = 0.02  # s: if this period were in ms, the sampling rate would be 50 kHz
WINDOW, USUAL = 7, 95.0  # samples in a window (at most 3 outliers); percentile of usual values
FAR, STEPS = 10.0, 5.0  # factors on the usual distance from the median and on the usual move
COARSE = 0.05  # minimum encoder step that is reported, relative to the rms move per sample
SAME = 0.15  # maximum relative difference between a measured ratio and the factor of a unit
STANDS = 0.5  # fraction of samples of a held torque that equal the sample before
LOWEST = 0.1  # fraction of the torque's power at its lowest frequencies
_TURN = 2 * np.pi
RATIOS = {"speed=rpm": 60 / _TURN, "speed=deg/s": 360 / _TURN, "speed=rev/s": 1 / _TURN,
          "angle=deg": _TURN / 360}  # fmt: skip
"""Ratios of a logged speed to the slope of the angle if the unit of one of them is wrong."""
_MEASURED = re.compile(r"meas|actual|\bact\b|_act|current|_ad|feedback|\bi_?q\b|effort", re.I)
_COMMAND = re.compile(r"ref|cmd|command|set|desired|demand|target", re.I)


def examine(raw: Raw, record: Record, remarks: Sequence[str]) -> tuple[Finding, ...]:
    """Return the findings of all checks.

    If there are outliers, the signs are not checked, because outliers hide the relation of torque
    and motion.

    Parameters
    ----------
    raw : Raw
        Signals as sampled.
    record : Record
        Record of the same signals on an even grid.
    remarks : sequence of str
        Corrections of the time stamps.
    """
    known = np.isfinite(raw.signals[raw.motion])
    motion, turn = raw.signals[raw.motion][known], 0.0
    if raw.motion == "angle":
        motion, turn = unwrapped(motion)
    times = raw.time[known][outliers(motion)]
    rows = {
        "time stamps": time_stamps(raw, record, remarks),
        "wrapping of the angle": wrapping(motion, turn),
        "clipping of the torque": clipping(raw.signals["torque"]),
        "clocks": clocks(raw, record.period),
        "units": units(raw, record.period),
        "resolution": coarse(raw, motion),
        "torque between samples": torque(raw, record.versions),
        "outliers of the motion": outlying(raw.motion, times),
        "signs of torque and motion": None if len(times) else sign(raw.motion, record),
    }
    return tuple(Finding(*row[:2], name, *row[2:]) for name, row in rows.items() if row)


def time_stamps(raw: Raw, record: Record, remarks: Sequence[str]) -> Row:
    """Return a finding on the sampling rate, corrected time stamps and missing samples."""
    valid, rate = valid_of(record), 1 / record.period
    missing, gaps = 100 * float(np.mean(~valid)), np.diff(gaps_of(valid))
    texts = [f"{rate:.6g} Hz, {len(valid)} samples, {len(valid) / rate:.4g} s", *remarks]
    if len(gaps):
        texts.append(
            f"{missing:.2g} % missing in {len(gaps)} gaps, the longest {gaps.max() / rate:.3g} s; "
            "gaps are not used"
        )
    kind: Kind = "problem" if missing >= MISSING else "note" if texts[1:] else "ok"
    if missing >= ROUNDED and gaps.max() <= 2:  # an increment also needs the sample before
        even = (len(raw.time) - 1) / (raw.time[-1] - raw.time[0])
        texts.append(
            "if no row is missing and only the stamps are rounded, use --rate "
            f"{even:.5g} instead of the time"
        )
    return kind, "; ".join(texts)


def wrapping(angle: Array, turn: float) -> Row | None:
    """Return a finding if the angle was unwrapped, or moves too fast to be unwrapped."""
    fastest = float(np.abs(np.diff(angle)).max()) / (turn or np.inf)
    if fastest < WRAPS:
        return ("info", f"unwrapped, a turn is {turn:.6g} rad") if turn else None
    text = (
        f"the angle moves by up to {fastest:.2g} turns per sample; above half a turn, the "
        "direction is unknown: log the angle without wrapping or faster, or use the speed"
    )
    return "problem", text, "--speed COLUMN in place of --angle"


def clipping(u: Array) -> Row:
    """Return a finding on a torque (N,) that remains at its extreme value for three samples."""
    u = u[np.isfinite(u)]
    limit = (u == u.max()) | (u == u.min())
    share = 100 * float(np.mean(limit[2:] & limit[1:-1] & limit[:-2]))
    if not share or len(np.unique(u[:10_000])) <= LEVELS:
        return "ok", "none"
    text = (
        f"the torque is at its limit, {np.abs(u).max():.4g}, for {share:.2g} % of the "
        "time: this is harmless if the logged torque acted; if the log contains a command, or "
        "if the sensor is saturated, log the torque that acted, or excite less"
    )
    return "note" if share < CLIPPED else "problem", text


def clocks(raw: Raw, period: float) -> Row:
    """Return a finding on signals that are repeated or interpolated between their updates."""
    every = {name: rhythm(raw.signals[name]) for name in ("torque", raw.motion)}
    # a torque that is held for several samples is harmless
    slow = {n: k for n, (k, _, lines) in every.items() if k > 1 and (lines or n != "torque")}
    if not slow:
        return "ok", "torque and motion are updated at every sample"
    n = max(slow.values())
    text = (
        f"{' and '.join(slow)} is updated at every {n}th sample only; the samples between are "
        "repeated or interpolated: log both with one clock, or reduce the rate of the log"
    )
    return "problem", text, f"--resample {1 / period / n:.6g}"


def coarse(raw: Raw, motion: Array) -> Row | None:
    """Return a finding on the step of a coarse encoder, which is noise and not a model error."""
    name, step = raw.motion, resolution(motion)
    if step < COARSE * float(np.sqrt(np.mean(np.diff(motion) ** 2))):
        return None
    turn = f", {_TURN / step:.4g} a turn" if name == "angle" and not raw.linear else ""
    return (
        "info",
        f"the {name} has steps of {step:.4g} {SI[name]}{turn}: they are most of its noise",
    )


def units(raw: Raw, period: float) -> Row:
    """Return a finding on the units that were assumed."""
    doubtful = [*raw.signals, *["time"] * (period >= SECONDS)]
    assumed = [n for n in SI if n in doubtful and n not in {*raw.unit, "torque"}]
    if not assumed:
        return "ok", "stated, or certain"
    taken = ", ".join(f"{name} in {SI[name]}" for name in assumed)
    text = f"not stated; assumed: {taken}. No log reveals a wrong unit, which scales the estimates"
    return "note", text, " ".join(f"--unit {name}={SI[name]}" for name in assumed)


def refuse_nonsense(raw: Raw) -> None:
    """Raise a LogError if a signal is implausible in its unit.

    A unit that the file or an option states is rejected only if the ratio of the speed to the slope
    of the angle shows that it is wrong.
    """
    speeds = {name: raw.signals[name] for name in ("angle", "speed") if name in raw.signals}
    if "angle" in speeds:
        known, slope = np.isfinite(speeds["angle"]), np.full(len(raw.time), np.nan)
        angle = speeds["angle"][known]
        if "angle" not in raw.unit and (abs(abs(np.diff(angle)) - 355) < 5.5).any():
            raise LogError(
                "angle jumps by 360 between samples, like an angle in degrees that wraps: "
                "give --unit angle=deg, or --unit angle=rad if the angle is in rad"
            )
        slope[known] = np.gradient(unwrapped(angle)[0], raw.time[known])
        speeds["angle"] = slope
    if len(speeds) > 1:
        both = np.array([*speeds.values()])
        slope, speed = both[:, np.isfinite(both).all(axis=0)]
        ratio = abs(float(slope @ speed / (slope @ slope)))
        for unit, usual in RATIOS.items():
            if abs(ratio / usual - 1) < SAME:
                raise LogError(
                    f"speed is {ratio:.3g} times the slope of the angle, as in a wrong unit: give "
                    f"--unit {unit} (or the unit of the other signal is wrong)"
                )
    for name in speeds.keys() - raw.unit.keys():
        fast = float(np.nanpercentile(abs(speeds[name]), USUAL))
        if fast > FASTEST:
            raise LogError(
                f"the motor would turn at {fast:.3g} rad/s: is {name} in deg, rpm or counts? "
                f"Give the unit with --unit {name}=… or --scale {name}=FACTOR, or that of the time "
                f"with --unit time=…; if the speed is correct, give --unit {name}={SI[name]}"
            )


def outlying(name: str, times: Array) -> Row:
    """Return a finding on the times at which the motion is far from its neighbours."""
    if not len(times):
        return "ok", "none"
    at = ", ".join(f"{t:.6g}" for t in times[:4]) + " …" * (len(times) > 4)
    text = (
        f"the {name} jumps and returns within a few samples, which no axis can do, at {at} s "
        f"({len(times)} samples); such samples spoil all estimates. Empty these cells of the log: "
        "empty cells are not used. If a counter wraps there, give its number of counts: --counts N"
    )
    return "problem", text


def outliers(x: Array) -> Flags:
    """Return which samples (N,) of a motion are outliers: far away for at most three samples.

    This is Hampel's filter: it compares the distance from the median of seven samples with the
    usual distance. Without noise, this distance is 0 while the motion has one direction, and less
    than a few moves per sample where it reverses. Therefore an outlier must also exceed five times
    the usual move per sample.

    Examples
    --------
    >>> motion = np.sin(np.arange(1000) / 20)
    >>> motion[500] = 1e6
    >>> np.flatnonzero(outliers(motion)).tolist()
    [500]
    """
    distance, moves = np.abs(x - median_filter(x, WINDOW, mode="nearest")), np.abs(np.diff(x))
    if not distance.any():
        return np.zeros(len(x), bool)
    # an axis may rest most of the time, so samples without a move are ignored
    step = float(np.percentile(moves[moves > 0], USUAL))
    return distance > max(FAR * float(np.percentile(distance, USUAL)), STEPS * step)


def sign(motion: str, record: Record) -> Row:
    """Return a finding on the signs of torque and motion.

    At the lower end of the excited frequencies, an axis behaves like an inertia with friction: its
    acceleration leads the torque by 0 to 90°. Moreover, the mean power of the torque is positive,
    because friction only dissipates power.
    """
    ok, T, u = valid_of(record), record.period, record.torque
    speed = output_of(record)[1]
    s = spectra(u[ok], speed[ok], T)
    low = (np.cumsum(s.torque) - s.torque < LOWEST * s.torque.sum()) & (s.frequency > 0)
    faster = s.cross * (np.exp(1j * s.omega * T) - 1)
    along = float((faster[low] * np.exp(-0.25j * np.pi)).sum().real)
    # torque k acts on [t_k, t_{k+1}), so its power is computed from the mean speed in that interval
    after = np.append(speed[1:], speed[-1])
    moving = after if motion == "angle" else (speed + after) / 2
    if along >= 0 or float(np.mean((u * moving)[ok])) >= 0:
        return "ok", "the torque drives the motion"
    text = "torque and motion have opposite signs: reverse one of them"
    return "problem", text, "--scale torque=-1"


def torque_kind(raw: Raw, stated: str | None, column: str) -> tuple[str, str]:
    """Return whether a torque is held or smooth between its samples, and the reason.

    A command jumps at each sample and is constant until the next one. A measured current also
    changes between samples. Mistaking one kind for the other causes a delay of half a sample.
    """
    u = raw.signals["torque"][np.isfinite(raw.signals["torque"])][:LONGEST]
    if stated is not None:
        return stated, "as stated"
    if len(np.unique(u)) <= LEVELS or np.mean(np.diff(u) == 0) > STANDS:
        return "held", "it switches between levels, or is constant between jumps"
    for kind, names in (("held", _COMMAND), ("smooth", _MEASURED)):
        if names.search(column):
            return kind, f"its column is called {column}; use --torque-is for the other kind"
    return "held", "assumed to be a command; for a measured current use --torque-is smooth"


def torque(raw: Raw, about: Mapping[str, str]) -> Row:
    """Return a finding on the assumed torque between samples, and the reason."""
    text = f"{about['torque']}: {about['torque_because']}; half a sample of delay depends on it"
    if raw.unit.get("torque") in ("V", "mV"):
        text += ". It is a voltage: f_m then also includes the damping due to back-EMF"
    return "info", text
