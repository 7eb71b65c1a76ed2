"""Checks of a log: its sampling, its units, and the relation of torque and motion."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from flexaxis.experiments.logs.axis_file import output_of
from flexaxis.experiments.logs.findings import Finding, Kind, LogError
from flexaxis.experiments.logs.mapping import Raw
from flexaxis.experiments.logs.signals import LONGEST, gaps_of, resolution, rhythm, unwrapped
from flexaxis.experiments.logs.spectra import spectra
from flexaxis.experiments.logs.units import SI, UNITS
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Told = Iterator[tuple[Kind, str, str]]
"""Kind and text of each finding, and the option to type."""

FASTEST = 1e4  # rad/s, maximum plausible motor speed; milling spindles are slower
MISSING, CLIPPED = 20.0, 1.0  # % of the samples that are missing, or clipped: limits of a problem
WRAPS = 0.35  # turns per sample, limit of a problem; above 0.5 the direction is ambiguous
RUN, LEVELS = 3, 3  # consecutive samples at a limit; maximum number of levels of a switched torque
SECONDS = 0.02  # s: if this period were in ms, the sampling rate would be 50 kHz
WINDOW, USUAL = 7, 95.0  # samples in a window (at most 3 outliers); percentile of usual values
FAR, STEPS = 10.0, 5.0  # factors on the usual distance from the median and on the usual move
COARSE = 0.05  # minimum encoder step that is reported, relative to the rms move per sample
LATE = 0.3  # samples: minimum delay of a filtered speed relative to the slope of the angle
SAME = 0.15  # maximum relative difference between a measured ratio and the factor of a unit
STANDS = 0.5  # fraction of samples of a held torque that equal the sample before
_MEASURED = re.compile(r"meas|actual|\bact\b|_act|current|_ad|feedback|\bi_?q\b|effort", re.I)
_COMMAND = re.compile(r"ref|cmd|command|set|desired|demand|target", re.I)


@dataclass(frozen=True)
class Evidence:
    """A log as it was sampled, and the record that was made from it.

    Attributes
    ----------
    raw : Raw
        Signals as sampled.
    record : Record
        Record of the same signals on an even grid.
    remarks : tuple of str
        Corrections of the time stamps.
    """

    raw: Raw
    record: Record
    remarks: tuple[str, ...]

    @cached_property
    def valid(self) -> Flags:
        """Whether each sample (N,) is complete."""
        valid = self.record.valid
        return np.ones(len(self.record.time), bool) if valid is None else valid

    @cached_property
    def speed(self) -> Array:
        """Motor speed (N,), or increment of the motor angle per sample period [rad/s]."""
        return np.asarray(getattr(self.record, output_of(self.record)))

    @cached_property
    def motion(self) -> tuple[Array, float]:
        """Known samples of the angle or speed, and the turn by which it was unwrapped, or 0."""
        known = self.raw.signals[self.raw.motion]
        known = known[np.isfinite(known)]
        return unwrapped(known) if self.raw.motion == "angle" else (known, 0.0)


def examine(e: Evidence) -> tuple[Finding, ...]:
    """Return the findings of all checks.

    If there are outliers, the remaining checks are skipped, because outliers hide the relation of
    torque and motion.
    """
    findings = list[Finding]()
    for (name, passed), check in CHECKS.items():
        own = [Finding(kind, text, name, command) for kind, text, command in check(e)]
        findings += own or [Finding("ok", passed, name)] * bool(passed)
        if check is outliers_of and own:
            break
    return tuple(findings)


def time_stamps(e: Evidence) -> Told:
    """Yield a finding on the sampling rate, corrected time stamps and missing samples."""
    missing, rate = 100 * float(np.mean(~e.valid)), 1 / e.record.period
    texts = [f"{rate:.6g} Hz, {len(e.valid)} samples, {len(e.valid) / rate:.4g} s", *e.remarks]
    if len(gaps := np.diff(gaps_of(e.valid))):
        texts.append(
            f"{missing:.2g} % missing in {len(gaps)} gaps, the longest {gaps.max() / rate:.3g} s; "
            "gaps are not used"
        )
    kind: Kind = "note" if texts[1:] else "ok"
    yield "problem" if missing >= MISSING else kind, "; ".join(texts), ""


def wrapping(e: Evidence) -> Told:
    """Yield a finding if the angle was unwrapped, or moves too fast to be unwrapped."""
    angle, turn = e.motion
    fastest = float(np.abs(np.diff(angle)).max()) / (turn or np.inf)
    if fastest >= WRAPS:
        text = (
            f"the angle moves by up to {fastest:.2g} turns per sample; above half a turn, the "
            "direction is unknown: log the angle without wrapping or faster, or use the speed"
        )
        yield "problem", text, "--speed COLUMN in place of --angle"
    elif turn:
        yield "info", f"unwrapped, a turn is {turn:.6g} rad", ""


def clipping(e: Evidence) -> Told:
    """Yield a finding if the torque remains at its extreme value."""
    u = e.raw.signals["torque"]
    u = u[np.isfinite(u)]
    limit = np.sign((u == u.max()) * 1.0 - (u == u.min()))
    share = 100 * float(np.mean(np.abs(np.convolve(limit, np.ones(RUN), "valid")) == RUN))
    if share and len(np.unique(u[:10_000])) > LEVELS:
        text = (
            f"the torque is at its limit, {np.abs(u).max():.4g}, for {share:.2g} % of the "
            "time: this is harmless if the logged torque acted; if the log contains a command, or "
            "if the sensor is saturated, log the torque that acted, or excite less"
        )
        yield "note" if share < CLIPPED else "problem", text, ""


def clocks(e: Evidence) -> Told:
    """Yield a finding on signals that are repeated or interpolated between their updates."""
    every = {name: rhythm(e.raw.signals[name]) for name in ("torque", e.raw.motion)}
    # a torque that is held for several samples is harmless
    slow = {n: k for n, (k, _, lines) in every.items() if k > 1 and (lines or n != "torque")}
    if slow:
        n = max(slow.values())
        text = (
            f"{' and '.join(slow)} is updated at every {n}th sample only; the samples between are "
            "repeated or interpolated: log both with one clock, or reduce the rate of the log"
        )
        yield "problem", text, f"--resample {1 / e.record.period / n:.6g}"


def coarse(e: Evidence) -> Told:
    """Yield a finding on the step of a coarse encoder, which is noise and not a model error."""
    name, values = e.raw.motion, e.motion[0]
    step = resolution(values)
    if step >= COARSE * float(np.sqrt(np.mean(np.diff(values) ** 2))):
        turn = f", {2 * np.pi / step:.4g} a turn" if name == "angle" and not e.raw.linear else ""
        text = f"the {name} has steps of {step:.4g} {SI[name]}{turn}: they are most of its noise"
        yield "info", text, ""


def units(e: Evidence) -> Told:
    """Yield a finding on the units that were assumed."""
    open_to_doubt = e.raw.signals.keys() | {"time"} if e.record.period >= SECONDS else e.raw.signals
    assumed = [n for n in SI if n != "torque" and n in open_to_doubt and n not in e.raw.unit]
    if assumed:
        taken = ", ".join(f"{name} in {SI[name]}" for name in assumed)
        text = (
            f"not stated; assumed: {taken}. No log reveals a wrong unit, which scales the estimates"
        )
        yield "note", text, " ".join(f"--unit {n}={SI[n]}" for n in assumed)


def refuse_nonsense(raw: Raw) -> None:
    """Raise a LogError if a signal is implausible in its unit.

    A unit that the file or an option states is rejected only if the ratio of the speed to the slope
    of the angle shows that it is wrong.
    """
    if {"angle", "speed"} <= raw.signals.keys():
        ratio = abs(_beside(raw)[0])
        for name, unit in (
            ("speed", "rpm"),
            ("speed", "deg/s"),
            ("speed", "rev/s"),
            ("angle", "deg"),
        ):
            factor = UNITS[name][unit] ** (1 if name == "angle" else -1)
            if abs(ratio / factor - 1) < SAME:
                raise LogError(
                    f"speed is {ratio:.3g} times the slope of the angle, as if the {name} were in "
                    f"{unit}: give --unit {name}={unit} (or the unit of the other signal is wrong)"
                )
    for name in raw.signals.keys() - raw.unit.keys() - {"torque"}:
        values = raw.signals[name]
        jumps = np.abs(np.diff(values))
        if name == "angle" and ((jumps > 350) & (jumps < 360.5)).any():
            raise LogError(
                "angle jumps by 360 between samples, like an angle in degrees that wraps: "
                "give --unit angle=deg, or --unit angle=rad if the angle is in rad"
            )
        speed = float(np.nanpercentile(abs(_slope(raw) if name == "angle" else values), USUAL))
        if speed > FASTEST:
            raise LogError(
                f"the motor would turn at {speed:.3g} rad/s: is {name} in deg, rpm or counts? "
                f"Give the unit with --unit {name}=… or --scale {name}=FACTOR, or that of the time "
                f"with --unit time=…; if the speed is correct, give --unit {name}={SI[name]}"
            )


def _slope(raw: Raw) -> Array:
    """Return the slope of the angle (N,) [rad/s]; NaN at missing samples and their neighbours."""
    angle = raw.signals["angle"].copy()
    known = np.isfinite(angle)
    angle[known] = unwrapped(angle[known])[0]
    return np.asarray(np.gradient(angle, raw.time))


def _beside(raw: Raw) -> tuple[float, float]:
    """Return the ratio of a logged speed to the slope of the angle, and the speed's delay [s]."""
    slope, speed = _slope(raw)[:LONGEST], raw.signals["speed"][:LONGEST]
    known = np.isfinite(slope) & np.isfinite(speed)
    s = spectra(slope[known], speed[known], float(np.median(np.diff(raw.time))))
    moving = (s.torque > 0.01 * s.torque.max()) & (s.frequency > 0)
    turned = np.angle(s.cross[moving]) / s.omega[moving]
    ratio = float(slope[known] @ speed[known] / np.sum(slope[known] ** 2))
    return ratio, -float(np.median(turned))


def other_speed(e: Evidence) -> Told:
    """Yield a finding if a logged speed lags behind the slope of the angle, as after a filter."""
    late = _beside(e.raw)[1] if {"angle", "speed"} <= e.raw.signals.keys() else 0.0
    if late >= LATE * e.record.period:
        text = (
            f"the speed is {1e3 * late:.3g} ms later than the slope of the angle, as after a "
            "low-pass filter. The angle is used, because it is not filtered"
        )
        yield "info", text, ""


def outliers_of(e: Evidence) -> Told:
    """Yield a finding on samples of the motion that are far from their neighbours."""
    name, far = e.raw.motion, outliers(e.motion[0])
    if far.any():
        known = np.isfinite(e.raw.signals[name])
        jump = np.abs(np.diff(e.raw.signals[name][known])).max()
        at = ", ".join(f"{t:.6g}" for t in e.raw.time[known][far][:4]) + " …" * int(far.sum() > 4)
        text = (
            f"the {name} jumps by up to {jump:.5g} {SI[name]} and back within a few samples, which "
            f"no axis can do, at {at} s ({far.sum()} samples); such samples spoil all estimates. "
            "Empty these cells of the log: empty cells are not used. If a counter wraps there, "
            "give its number of counts: --counts N"
        )
        yield "problem", text, ""


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


def sign(e: Evidence) -> Told:
    """Yield a finding if torque and motion have opposite signs.

    At the lower end of the excited frequencies, an axis behaves like an inertia with friction: its
    acceleration leads the torque by 0 to 90°. Moreover, the mean power of the torque is positive,
    because friction only dissipates power.
    """
    u, T = e.record.torque, e.record.period
    s = spectra(u[e.valid], e.speed[e.valid], T)
    low, high = s.band
    bottom = (s.frequency > 0) & (s.frequency >= low) & (s.frequency < low + 0.1 * (high - low))
    faster = s.cross * (np.exp(1j * s.omega * T) - 1)
    along = float((faster[bottom] * np.exp(-0.25j * np.pi)).sum().real)
    # torque k acts on [t_k, t_{k+1}), so its power is computed from the mean speed in that interval
    after = np.append(e.speed[1:], e.speed[-1])
    moving = after if e.raw.motion == "angle" else (e.speed + after) / 2
    if along < 0 and float(np.mean((u * moving)[e.valid])) < 0:
        text = "torque and motion have opposite signs: reverse one of them"
        yield "problem", text, "--scale torque=-1"


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


def torque(e: Evidence) -> Told:
    """Yield a finding on the assumed torque between samples, and the reason."""
    kind, because = e.record.versions["torque"], e.record.versions["torque_because"]
    text = f"{kind}: {because}; half a sample of delay depends on it"
    if e.raw.unit.get("torque") in ("V", "mV"):
        text += ". It is a voltage: f_m then also includes the damping due to back-EMF"
    yield "info", text, ""


CHECKS: dict[tuple[str, str], Callable[[Evidence], Told]] = {
    ("time stamps", ""): time_stamps,
    ("wrapping of the angle", ""): wrapping,
    ("clipping of the torque", "none"): clipping,
    ("clocks", "torque and motion are updated at every sample"): clocks,
    ("units", "stated, or certain"): units,
    ("resolution", ""): coarse,
    ("torque between samples", ""): torque,
    ("outliers of the motion", "none"): outliers_of,
    ("signs of torque and motion", "the torque drives the motion"): sign,
    ("speed beside angle", ""): other_speed,
}
"""The checks; each key is the name of a check and the text shown if the check finds nothing."""
