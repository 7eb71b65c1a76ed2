"""What speaks against a log: how it was sampled, its units, and how torque and motion belong."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.signal import welch

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.logs.mapping import Raw
from flexaxis.experiments.logs.prepare import Prepared, knots, unwrapped
from flexaxis.experiments.logs.spectra import SEGMENT, Spectra, spectra
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SI = {"time": "s", "angle": "rad", "speed": "rad/s"}
FAST, FASTEST = 2000.0, 1e4  # rad/s: motors of axes stay below, spindles for milling stay below
ABSURD = 1e8  # times the usual; a converter of 24 bits has 1.7e7 steps
JITTER, MISSING, CLIPPED = 5.0, 20.0, 1.0  # % of a period; of the samples, where it matters
WRAPS = 0.35  # of a turn a sample: beyond half of one, the direction cannot be told
RUN, LEVELS = 3, 3  # samples at a limit; values of a torque that switches, and is not clipped
REGULAR, MOVING = 0.8, 3.0  # updates after the usual number of samples, by steps of resolution
LONGEST = 200_000  # samples that are looked at
SECONDS = 0.02  # s: if smaller steps were of ms, the log would be one of more than 50 kHz
WINDOW, USUAL = 7, 95.0  # samples, of which 3 may be outliers; percentile that they may not reach
FAR, STEPS = 10.0, 5.0  # times the usual distance from the median, and move, of an outlier
COARSE = 0.05  # of the rms move in a sample, that a step of an encoder is to be named
LATE = 0.3  # samples, that a speed is later than the slope of its angle
STILL = 0.02  # of the rms speed


@dataclass(frozen=True)
class Evidence:
    """A log as it was sampled, on its even grid, and as a record."""

    raw: Raw
    grid: Prepared
    record: Record
    stamps: str = ""  # what was done to the time stamps

    @cached_property
    def valid(self) -> Flags:
        """Where nothing is missing (N,)."""
        valid = self.record.valid
        return np.ones(len(self.record.time), bool) if valid is None else valid

    @cached_property
    def speed(self) -> Array:
        """Motor speed (N,) [rad/s]."""
        speed = self.record.speed if self.record.increment is None else self.record.increment
        assert speed is not None
        return speed

    @cached_property
    def spectra(self) -> Spectra:
        """Averaged spectra over pieces of 4 s, or half the log, of its longest run."""
        period = self.record.period
        length = min(len(self.speed) // 2, round(SEGMENT / period))
        edges = np.flatnonzero(np.diff(np.r_[False, self.valid, False].astype(int)))
        begin, end = max(edges.reshape(-1, 2).tolist(), key=lambda run: run[1] - run[0])
        run = slice(begin, end) if end - begin >= length else slice(None)
        return spectra(self.record.torque[run], self.speed[run], period, length=length)


def examine(e: Evidence) -> tuple[Finding, ...]:
    """Return everything that was looked at; outliers hide how torque and motion belong."""
    looks = [time_stamps(e), wrapping(e), clipping(e), clocks(e), units(e), resolution(e)]
    spoilt = outliers_of(e)
    belong = [] if spoilt.kind != "ok" else [torque(e), sign(e), other_speed(e)]
    return tuple(one for one in (*looks, spoilt, *belong) if one is not None)


def time_stamps(e: Evidence) -> Finding:
    """Return the rate, jitter of the stamps, and what is missing."""
    missing, rate = 100 * float(np.mean(~e.valid)), 1 / e.record.period
    text = f"{rate:.6g} Hz, {len(e.valid)} samples, {len(e.valid) / rate:.4g} s"
    text += f"; {e.stamps}" if e.stamps else ""
    edges = np.flatnonzero(np.diff(np.r_[1, e.valid, 1])).reshape(-1, 2)
    if len(edges):
        longest = float(np.diff(edges).max() / rate)
        text += f"; gaps: {len(edges)}, the longest {longest:.3g} s; nothing is learnt in them"
    for name, values in e.raw.signals.items():
        if infinite := int(np.isinf(values).sum()):
            text += f"; {name} is infinite in {infinite} samples, which are left out"
    command, jitter = "", 100 * e.grid.jitter
    if jitter >= JITTER:
        text += f"; stamps scatter by {jitter:.0f} % of a period, and signals were interpolated"
        text += ". If only the stamps are late, give the rate in place of the time"
        command = f"--rate {rate:.6g}"
    grave = missing >= MISSING and not command
    noted = missing or command or e.stamps
    kind: Literal["problem", "note", "ok"] = "problem" if grave else "note" if noted else "ok"
    return Finding(kind, text, "time stamps", missing, "% missing", command)


def wrapping(e: Evidence) -> Finding | None:
    """Return where turns were added, and where it cannot be told how many."""
    wrap, name = e.grid.wrap, "wrapping of the angle"
    if not wrap.turn:
        return None
    text = f"unwrapped at {wrap.jumps} samples, by {wrap.turn:.6g} rad each"
    if wrap.fastest < WRAPS:
        return Finding("info", text, name, float(wrap.jumps), "jumps")
    text += (
        f"; it moves by up to {wrap.fastest:.2g} of a turn in a sample, and beyond half a turn "
        "the direction is a guess: log the angle without wrapping or faster, or use the speed"
    )
    command = "--speed COLUMN in place of --angle"
    return Finding("problem", text, name, float(wrap.jumps), "jumps", command)


def clipping(e: Evidence) -> Finding:
    """Return whether the torque stands at its extreme value."""
    u = e.raw.signals["torque"]
    u, name = u[np.isfinite(u)], "clipping of the torque"
    runs = [
        np.convolve(u == extreme, np.ones(RUN), "same") > RUN - 0.5
        for extreme in (u.max(), u.min())
    ]
    share = 100 * float(np.mean(np.convolve(runs[0] | runs[1], np.ones(RUN), "same") > 0.5))
    if share == 0 or len(np.unique(u[:10_000])) <= LEVELS:
        return Finding("ok", "none", name)
    text = (
        f"the torque stands at its limit, {np.abs(u).max():.4g}: harmless if that is what acted; "
        "if it is what was asked for, or the sensor's end, log what acted, or excite less"
    )
    return Finding("note" if share < CLIPPED else "problem", text, name, share, "%")


def clocks(e: Evidence) -> Finding:
    """Return which signals are updated less often than the log has samples, or interpolated."""
    every = {name: updates_every(e.raw.signals[name]) for name in ("torque", e.raw.motion)}
    lines = {name: knots(e.raw.signals[name])[0] for name in every}
    name, slowest = "clocks", max(every[e.raw.motion], *lines.values())
    if slowest == 1:  # a torque that is held for longer than a sample is no harm
        return Finding("ok", f"torque and {e.raw.motion} are updated at every sample", name)
    which = next(n for n in every if slowest in (every[n], lines[n]))
    text = (
        f"{which} has a new value at every {slowest}th sample only, and is repeated or interpolated "
        "between: log both by one clock, or bring the log to the slower rate"
    )
    command = f"--resample {1 / e.record.period / slowest:.6g}"
    return Finding("problem", text, name, float(slowest), "samples", command)


def updates_every(values: Array) -> int:
    """Return after how many samples a signal is updated: 1 if at each, or if it cannot be told.

    A coarse signal repeats its values as well; it is taken for one of another clock only where it
    jumps by several of its steps, and after the same number of samples nearly always.
    """
    values = values[np.isfinite(values)][:LONGEST]
    changes = np.flatnonzero(np.diff(values))
    if len(changes) < 20 or len(changes) > 0.7 * len(values):
        return 1
    gaps = np.diff(changes)
    usual, step = round(float(np.median(gaps))), step_of(values)
    jumps = np.abs(values[changes + 1] - values[changes])
    coarse = step > 0 and float(np.median(jumps)) < MOVING * step
    regular = usual > 1 and float(np.mean(gaps % usual == 0)) > REGULAR
    return usual if regular and not coarse else 1


def step_of(values: Array) -> float:
    """Return the step of which a signal is made; 0 if it is finer than its changes."""
    values = values[np.isfinite(values)][:LONGEST]
    steps = np.abs(np.diff(values))
    moved = steps[steps > 1e-9 * float(np.ptp(values))]
    if not len(moved):
        return 0.0
    smallest = float(np.percentile(moved, 1))
    multiples = moved / smallest
    # steps without a quantum lie within .05 of a whole number in a tenth of the cases
    return smallest if np.mean(np.abs(multiples - np.rint(multiples)) < 0.05) > 0.9 else 0.0


def resolution(e: Evidence) -> Finding | None:
    """Return the step of a coarse encoder, which is noise of the motion and no wrong model."""
    name = e.raw.motion
    step, moves = step_of(e.grid.signals[name]), np.diff(e.grid.signals[name])
    if step < COARSE * float(np.sqrt(np.mean(moves**2))):
        return None
    turn = f", {2 * np.pi / step:.4g} a turn" if name == "angle" and not e.raw.linear else ""
    text = f"the {name} has steps of {step:.4g} {SI[name]}{turn}: they are most of its noise"
    return Finding("info", text, "resolution", step, SI[name])


def units(e: Evidence) -> Finding:
    """Return which units were stated, and which were taken for granted."""
    assumed = [n for n in SI if (n == "time" or n in e.raw.signals) and n not in e.raw.stated]
    if e.record.period < SECONDS and "time" in assumed:
        assumed.remove("time")
    if not assumed:
        return Finding("ok", "stated, or beyond doubt", "units")
    for name in ("angle", "speed"):
        usual = usual_speed(e.raw, name)
        if usual > FAST:
            text = (
                f"not stated, and the motor would turn at {usual:.3g} rad/s, as spindles do but "
                f"hardly an axis: {other_units(name)}"
            )
            return Finding("problem", text, "units", usual, "rad/s", f"--unit {name}=UNIT")
    text = "not stated; taken " + ", ".join(f"{name} for {SI[name]}" for name in assumed)
    text += ". No log shows whether that is so; estimates are wrong by the factor if it is not"
    options = " ".join(f"--unit {name}={SI[name]}" for name in assumed)
    return Finding("note", text, "units", command=options)


def refuse_nonsense(raw: Raw) -> None:
    """Raise a LogError for signals that cannot be used or must be in another unit.

    A stated unit, in the file or by an option, is believed where it can be.
    """
    for name, values in raw.signals.items():
        if not np.isfinite(values).any() or np.nanmax(values) == np.nanmin(values):
            raise LogError(
                f"{name} is constant or empty over all {len(values)} samples: the wrong column, "
                "or an axis that stood still"
            )
    u = raw.signals["torque"]
    size = np.where(np.isfinite(u), np.abs(u), 0.0)  # what is not is missing
    at, usual = int(np.argmax(size)), float(np.percentile(size, 99))
    if usual > 0 and size[at] > ABSURD * usual:  # it would throw every estimator
        raise LogError(
            f"torque is {u[at]:.3g} at {raw.time[at]:.6g} s (sample {at}), and up to {usual:.3g} "
            "in 99 of 100 samples: that is no torque. Correct it, or cut the log there"
        )
    step = float(np.median(np.diff(raw.time)))
    if step >= 1 and "time" not in raw.stated:
        raise LogError(
            f"time advances by {step:g} s a sample: is it in ms, us or ns? State it with "
            "--unit time=us, or, if it is right, --unit time=s"
        )
    angle = raw.signals.get("angle")
    if angle is not None and "angle" not in raw.stated:
        jumps = np.abs(np.diff(angle[np.isfinite(angle)]))
        if ((jumps > 350) & (jumps < 360.5)).any():
            raise LogError(
                "angle jumps by 360 between samples, as an angle in degrees does that wraps: "
                "state it with --unit angle=deg (or rad, if that is what it is)"
            )
    if angle is not None and "speed" in raw.signals:
        _refuse_other_speed(raw)
    for name in ("angle", "speed"):
        if usual_speed(raw, name) > FASTEST:
            raise LogError(
                f"the motor would turn at {usual_speed(raw, name):.3g} rad/s: {other_units(name)}"
            )


def _refuse_other_speed(raw: Raw) -> None:
    """Compare the speed with the slope of the angle: their ratio shows a wrong unit."""
    slope, speed = _slope(raw), raw.signals["speed"]
    both = np.isfinite(slope) & np.isfinite(speed)
    ratio = float(slope[both] @ speed[both] / max(slope[both] @ slope[both], 1e-300))
    for name, unit, factor in (
        ("speed", "rpm", 60 / (2 * np.pi)),
        ("speed", "deg/s", 180 / np.pi),
        ("speed", "rev/s", 0.159155),
        ("angle", "deg", np.pi / 180),
    ):
        if abs(abs(ratio) / factor - 1) < 0.15:
            raise LogError(
                f"speed is {ratio:.3g} times the slope of the angle, as if the {name} were in "
                f"{unit}: state it with --unit {name}={unit} (or is the other in another unit?)"
            )


def _slope(raw: Raw) -> Array:
    """Return the slope of the angle (N,), NaN beside what is missing."""
    angle = raw.signals["angle"].copy()
    known = np.isfinite(angle)
    angle[known] = unwrapped(angle[known])[0]
    return np.asarray(np.gradient(angle, raw.time))


def usual_speed(raw: Raw, name: str) -> float:
    """Return the speed [rad/s] below which a motor is for 95 % of a log; 0 for a stated unit."""
    values = raw.signals.get(name)
    if values is None or name in raw.stated:
        return 0.0
    known = np.isfinite(values)
    speed = values[known]
    if name == "angle":
        speed = np.diff(unwrapped(speed)[0]) / np.diff(raw.time[known])
    return float(np.percentile(abs(speed), 95))


def other_units(name: str) -> str:
    """Return a question for the unit of an angle or a speed, and how to state it."""
    units = "deg or counts" if name == "angle" else "rpm or deg/s"
    return (
        f"is {name} in {units}? State it with --unit {name}=… or --scale {name}=FACTOR, or time "
        f"with --unit time=…; if all is right, with --unit {name}={SI[name]}"
    )


def outliers_of(e: Evidence) -> Finding:
    """Return samples of the motion that are far from those before and after them."""
    name, label = e.raw.motion, "outliers of the motion"
    known = np.isfinite(e.raw.signals[name])
    time, signal = e.raw.time[known], e.raw.signals[name][known]
    far = outliers(unwrapped(signal)[0] if name == "angle" else signal)
    if not far.any():
        return Finding("ok", "none", label)
    jump = np.abs(np.diff(signal)).max()
    at = ", ".join(f"{t:.6g}" for t in time[far][:4]) + " …" * (far.sum() > 4)
    text = (
        f"the {name} jumps by up to {jump:.5g} {SI[name]} and back within some samples, as no axis "
        f"moves, at {at} s; that spoils all estimates. Empty such cells of the log: what is "
        "missing is not used. If a counter wraps there, give its counts: --counts N"
    )
    return Finding("problem", text, label, float(far.sum()), "samples")


def outliers(x: Array) -> Flags:
    """Return which samples (N,) of a motion are none: far out, and back within three samples.

    Hampel's filter: the distance from the median of seven samples, over what it usually is. It is
    0 where the motion has one direction; where it turns, it is less than the axis moves in a
    sample, which decides where the noise is low.

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
    # of an axis that rests most of the time, the moves count
    step = float(np.percentile(moves[moves > 0], USUAL))
    return distance > max(FAR * float(np.percentile(distance, USUAL)), STEPS * step)


def sign(e: Evidence) -> Finding:
    """Return whether torque and motion have opposite signs.

    At the lower end of the excitation an axis is inertia and friction: its acceleration leads the
    torque by 0 to 90°, and friction takes power, and never gives it.
    """
    name, s = "signs of torque and motion", e.spectra
    low, high = s.band
    bottom = (s.frequency > 0) & (s.frequency >= low) & (s.frequency < low + 0.1 * (high - low))
    faster = s.cross * (np.exp(2j * np.pi * s.frequency * e.record.period) - 1)
    along = float((faster[bottom] * np.exp(-0.25j * np.pi)).sum().real)
    # the torque k acts on the mean speed over [t_k, t_{k+1})
    after = np.append(e.speed[1:], e.speed[-1])
    moving = after if e.raw.motion == "angle" else (e.speed + after) / 2
    if along < 0 and float(np.mean((e.record.torque * moving)[e.valid])) < 0:
        text = "torque and motion have opposite signs: turn one of them"
        return Finding("problem", text, name, command="--scale torque=-1")
    return Finding("ok", "the torque drives the motion", name)


def other_speed(e: Evidence) -> Finding | None:
    """Return whether a logged speed is later than the slope of the angle beside it: a filter."""
    if not {"angle", "speed"} <= e.raw.signals.keys():
        return None
    slope, speed = _slope(e.raw)[:LONGEST], e.raw.signals["speed"][:LONGEST]
    known = np.isfinite(slope) & np.isfinite(speed)
    s = spectra(slope[known], speed[known], e.record.period)
    moving = s.torque > 0.01 * s.torque.max()
    omega = 2 * np.pi * s.frequency[moving]
    late = -float(np.median(np.angle(s.cross[moving])[omega > 0] / omega[omega > 0]))
    if late < LATE * e.record.period:
        return Finding("ok", "the speed is the slope of the angle", "speed beside angle")
    text = (
        f"the speed is {1e3 * late:.3g} ms later than the slope of the angle, as behind a "
        "low-pass. The angle is used, which is not filtered"
    )
    return Finding("info", text, "speed beside angle", 1e3 * late, "ms")


SPOTLESS = 1e-9  # of its power in noise: no sensor is so good
STANDS = 0.5  # of the samples that equal the one before
SHORT = 256  # samples in a piece, for the coherence
MOVES, MOVES_NOT = 0.5, 0.3  # of the coherence that a torque which acts would have
EXPECTED = 0.1  # coherence below which nothing can be told from its absence
STATED, UNSEEN = "as stated", "its samples do not show it"
_WORDS = {"held": "a command", "smooth": "a measured current"}
_MEASURED = re.compile(r"meas|actual|\bact\b|_act|current|_ad|feedback|\bi_?q\b|effort", re.I)
_COMMAND = re.compile(r"ref|cmd|command|set|desired|demand|target", re.I)


def torque_kind(raw: Raw, stated: str | None, column: str) -> tuple[str, str]:
    """Return whether a torque is held or smooth between its samples, and why.

    A command jumps at each sample and stays; what is logged of it acts. A measured current goes on
    changing between samples, passes the filters of its amplifier, and has noise of its sensor on
    it, which does not move the motor. To take one for the other is half a sample of delay.
    """
    motion = raw.signals[raw.motion]
    known = np.isfinite(raw.signals["torque"]) & np.isfinite(motion)
    speed = motion[known][:LONGEST]
    if raw.motion == "angle":  # the speed but for a factor
        speed = np.diff(unwrapped(speed)[0])
    u, period = (
        raw.signals["torque"][known][:LONGEST][-len(speed) :],
        float(np.median(np.diff(raw.time))),
    )
    shape = _by_shape(u, period)
    seen = ("held", shape) if shape else _by_motion(u, speed, period)
    if stated is not None:
        against = seen is not None and seen[0] != stated
        return stated, f"{STATED}, but {seen[1]}" if seen and against else STATED
    if seen is not None:
        return seen
    for kind, names in (("held", _COMMAND), ("smooth", _MEASURED)):
        if names.search(column):
            return kind, f"{UNSEEN}, but its column is called {column}"
    return "held", f"{UNSEEN}; taken for a command"


def _by_shape(u: Array, period: float) -> str:
    """Return why a torque must be a command, or nothing."""
    if len(np.unique(u)) <= LEVELS:
        return "it switches between few values"
    same = np.diff(u) == 0
    if same.mean() > STANDS and np.abs(np.diff(u)).max() > 0.1 * np.ptp(u):
        return f"it stays at {100 * same.mean():.0f} % of the samples, and jumps between"
    frequency, power = welch(
        u, fs=1 / period, nperseg=min(len(u) // 2, 4096), window="blackmanharris"
    )
    share = power / power.sum()
    floor = float(np.median(share[frequency > 0.4 / period]) * len(share))
    return "it has no noise on it, as what was computed" if floor < SPOTLESS else ""


def _by_motion(u: Array, speed: Array, period: float) -> tuple[str, str] | None:
    """Tell by whether its fastest parts, above a quarter of the rate, move the motor."""
    a, u = np.diff(speed) / period, u[:-1]
    length = min(SHORT, len(u) // 16)
    s = spectra(u, a, period, length=length)
    fast, band = s.frequency > 0.25 / period, s.torque > 0.01 * s.torque.max()
    # of white noise, the coherence of averages over overlapping pieces
    seen = float(np.mean(s.coherence[fast])) - length / len(u)
    gain = float(np.median(np.abs(s.cross[band]) / s.torque[band]))
    expected = min(float(gain**2 * s.torque[fast].sum() / s.motion[fast].sum()), 1.0)
    if seen > MOVES:
        return "held", "its fastest parts move the motor, or come from its motion sample by sample"
    if expected > EXPECTED and seen < MOVES_NOT * expected:
        return "smooth", "its fastest parts are noise of a sensor: they do not move the motor"
    return None


def torque(e: Evidence) -> Finding:
    """Return how the torque was taken between its samples, and why."""
    name, kind = "torque between samples", e.record.versions["torque"]
    other, because = "held" if kind == "smooth" else "smooth", e.record.versions["torque_because"]
    text, against, unseen = f"{kind}: {because}", f"{STATED}, but" in because, UNSEEN in because
    if e.raw.unit.get("torque") in ("V", "mV"):
        text += ". It is a voltage: f_m then holds the friction by back-EMF as well"
    if not (against or unseen):
        return Finding("info", text, name)
    if unseen:
        text += f". If it is {_WORDS[other]}, say so: half a sample of delay depends on it"
    return Finding("problem" if against else "note", text, name, command=f"--torque-is {other}")
