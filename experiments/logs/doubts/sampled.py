"""How a log was sampled: stamps, gaps, wrapping, clipping, clocks, units; what cannot be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.findings import Finding, Kind
from flexaxis.experiments.logs.mapping import Raw
from flexaxis.experiments.logs.prepare import unwrapped

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SI = {"time": "s", "angle": "rad", "speed": "rad/s"}
FAST = 2000.0  # rad/s, 19 000 rpm: motors of axes stay below, spindles do not
ABSURD = 1e8  # times the usual; a converter of 24 bits has 1.7e7 steps
FASTEST = 1e4  # rad/s, 95 000 rpm: above motor spindles for milling, sold up to some 60 000 rpm
JITTER = 5.0  # % of a period
MISSING = 20.0  # %: where so much is missing, what there is cannot be trusted either
WRAPS = 0.35  # of a turn a sample: beyond half of one, the direction cannot be told
RUN = 3  # samples in a row
LEVELS = 3  # values: a torque that has no more of them switches, and is not clipped
CLIPPED = 1.0  # % of the samples
REGULAR = 0.8  # of the updates that come after the usual number of samples
MOVING = 3.0  # steps of its resolution by which a signal moves between its updates
LONGEST = 200_000  # samples that are looked at
SECONDS = 0.02  # s: if smaller steps were of ms, the log would be one of more than 50 kHz


def time_stamps(e: Evidence) -> Finding:
    """Return the rate, jitter of the stamps, and what is missing."""
    name, missing = "time stamps", 100 * float(np.mean(~e.usable))
    text = f"{1 / e.period:.6g} Hz, {len(e.time)} samples, {len(e.time) * e.period:.4g} s"
    jitter = 100 * e.prepared.jitter
    edges = np.flatnonzero(np.diff(np.r_[1, e.usable, 1]))
    if len(edges):
        gaps, longest = len(edges) // 2, float((edges[1::2] - edges[::2]).max() * e.period)
        text += f"; {gaps} gap{'s' * (gaps > 1)}, the longest {longest:.3g} s; marked, not updated"
        text += " on"
    infinite = _infinite(e)
    if infinite:
        text += f". Infinite, and no numbers: {infinite}; ask what wrote the log"
    if jitter >= JITTER:
        text += (
            f"; stamps scatter by {jitter:.0f} % of a period, and signals were interpolated. If "
            "only the stamps are late, give the rate in place of the time"
        )
        rate = f"--rate {1 / e.period:.6g}"
        return Finding("note", text, name, missing, "% missing", rate)
    kind: Kind = "problem" if missing >= MISSING else "note" if missing else "ok"
    return Finding(kind, text, name, missing, "% missing")


def _infinite(e: Evidence) -> str:
    """Return in words which signals of a log have infinite values, and how many."""
    there = {n: getattr(e.raw, n) for n in ("torque", "angle", "speed", "load_angle")}
    counts = {n: int(np.isinf(values).sum()) for n, values in there.items() if values is not None}
    return ", ".join(
        f"{n} in {count} sample{'s' * (count > 1)}" for n, count in counts.items() if count
    )


def wrapping(e: Evidence) -> Finding | None:
    """Return where turns were added, and where it cannot be told how many."""
    if e.raw.angle is None:
        return None
    name, wrap = "wrapping of the angle", e.prepared.wrap
    if not wrap.turn:
        return Finding("ok", "none: the angle is not confined to one turn", name, 0.0, "jumps")
    text = f"unwrapped at {wrap.jumps} samples, by {wrap.turn:.6g} rad each"
    if wrap.fastest < WRAPS:
        return Finding("ok", text, name, float(wrap.jumps), "jumps")
    text += (
        f"; it moves by up to {wrap.fastest:.2g} of a turn in a sample, and beyond half a turn "
        "the direction is a guess: log the angle without wrapping or faster, or use the speed"
    )
    command = "--speed COLUMN in place of --angle"
    return Finding("problem", text, name, float(wrap.jumps), "jumps", command)


def clipping(e: Evidence) -> Finding:
    """Return whether the torque stands at its extreme value."""
    u = e.raw.torque[np.isfinite(e.raw.torque)]
    name, stuck = "clipping of the torque", at_limit(u)
    share = 100 * float(stuck.mean())
    if share == 0 or len(np.unique(u[:10_000])) <= LEVELS:
        return Finding("ok", "none", name, 0.0, "%")
    text = (
        f"the torque stands at its limit, {np.abs(u).max():.4g}: harmless if that is what acted; "
        "if it is what was asked for, or the sensor's end, log what acted, or excite less"
    )
    return Finding("note" if share < CLIPPED else "problem", text, name, share, "%")


def at_limit(u: Array) -> Flags:
    """Return where a signal stands at its highest or lowest value for three or more samples."""
    stuck = np.zeros(len(u), bool)
    for extreme in (u.max(), u.min()):
        run = np.convolve(u == extreme, np.ones(RUN), "valid") > RUN - 0.5
        for shift in range(RUN):
            stuck[shift : len(u) - RUN + 1 + shift] |= run
    return stuck


def clocks(e: Evidence) -> Finding:
    """Return which signals are updated less often than the log has samples."""
    signals = {name: getattr(e.raw, name) for name in ("torque", "angle", "speed")}
    every = {name: updates_every(v) for name, v in signals.items() if v is not None}
    name, slowest = "clocks", max(k for n, k in every.items() if n != "torque")
    text = ", ".join(f"{n} at every {'' if k == 1 else f'{k}. '}sample" for n, k in every.items())
    if slowest == 1:  # a torque that is held for longer than a sample is no harm
        return Finding("ok", f"updated: {text}", name, float(every["torque"]), "samples")
    text = (
        f"updated: {text}. What is repeated is late by up to {slowest - 1} samples: log both by "
        "one clock, or bring the log to the slower rate"
    )
    command = f"--resample {1 / e.period / slowest:.6g}"
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
    coarse = step is not None and float(np.median(jumps)) < MOVING * step
    regular = float(np.mean(gaps % usual == 0)) if usual > 1 else 0.0
    return usual if usual > 1 and regular > REGULAR and not coarse else 1


def step_of(values: Array) -> float | None:
    """Return the step of which a signal is made; None if it is finer than its changes."""
    steps, span = np.abs(np.diff(values)), float(np.ptp(values))
    moved = steps[steps > 1e-9 * span]
    if not len(moved):
        return None
    smallest = float(np.percentile(moved, 1))
    multiples = moved / smallest
    # steps without a quantum lie within .05 of a whole number in a tenth of the cases
    return smallest if np.mean(np.abs(multiples - np.rint(multiples)) < 0.05) > 0.9 else None


def units(e: Evidence) -> Finding:
    """Return which units were stated, and which were taken for granted."""
    there = [name for name in SI if getattr(e.raw, name) is not None]
    assumed = [name for name in there if name not in e.raw.stated]
    if e.period < SECONDS and "time" in assumed:
        assumed.remove("time")
    if not assumed:
        return Finding("ok", "stated, or beyond doubt", "units")
    for name in ("angle", "speed"):
        usual = usual_speed(e.raw, name)
        if usual is not None and usual > FAST:
            text = (
                f"nobody stated them, and the motor would turn at {usual:.3g} rad/s, as spindles "
                f"do but hardly an axis: {other_units(name)}"
            )
            return Finding("problem", text, "units", usual, "rad/s", f"--unit {name}=UNIT")
    taken = ", ".join(f"{name} for {SI[name]}" for name in assumed)
    options = " ".join(f"--unit {name}={SI[name]}" for name in assumed)
    text = (
        f"nobody stated them; taken {taken}. No log tells whether that is so, and all estimates "
        "would be wrong by the factor of the unit. State them, in these units or others"
    )
    return Finding("note", text, "units", command=options)


def refuse_nonsense(raw: Raw) -> None:
    """Raise a LogError for signals that cannot be used or must be in another unit.

    A unit that somebody stated, in the file or by an option, is believed where it can be.
    """
    for name in ("torque", "angle", "speed"):
        values = getattr(raw, name)
        if values is None:
            continue
        if not np.isfinite(values).any():
            raise LogError(f"{name} holds no numbers in any of its {len(values)} samples")
        if np.nanmax(values) == np.nanmin(values):
            raise LogError(
                f"{name} is constant, {np.nanmin(values):g} over all {len(values)} samples: the "
                "wrong column, or an axis that stood still"
            )
    size = np.where(np.isfinite(raw.torque), np.abs(raw.torque), 0.0)  # what is not is missing
    at, usual = int(np.argmax(size)), float(np.percentile(size, 99))
    if usual > 0 and size[at] > ABSURD * usual:  # it would throw every estimator
        raise LogError(
            f"torque is {raw.torque[at]:.3g} at {raw.time[at]:.6g} s (sample {at}), and up to "
            f"{usual:.3g} in 99 of 100 samples: that is no torque. Correct it, or cut the log there"
        )
    if raw.angle is not None and "angle" not in raw.stated:
        _refuse_degrees(raw.angle)
    if raw.speed is not None and raw.angle is not None:
        _refuse_other_speed(raw)
    step = float(np.median(np.diff(raw.time))) if len(raw.time) > 1 else 0.0
    if step >= 1 and "time" not in raw.stated:
        raise LogError(
            f"time advances by {step:g} s a sample: is it in ms, us or ns? State it with "
            "--unit time=us, or, if it is right, --unit time=s"
        )
    for name in ("angle", "speed"):
        usual_of = usual_speed(raw, name)
        if usual_of is not None and usual_of > FASTEST:
            raise LogError(f"the motor would turn at {usual_of:.3g} rad/s: {other_units(name)}")


def _refuse_degrees(angle: Array) -> None:
    jumps = np.abs(np.diff(angle[np.isfinite(angle)]))
    turns = jumps[(jumps > 300) & (jumps < 360.5)]
    if len(turns) and turns.max() > 350:
        raise LogError(
            f"angle jumps by {turns.max():.4g} between samples, as an angle in degrees does that "
            "wraps around: state it with --unit angle=deg (or rad, if that is what it is)"
        )


def _refuse_other_speed(raw: Raw) -> None:
    """Compare the speed with the slope of the angle: their ratio tells a wrong unit."""
    assert raw.angle is not None and raw.speed is not None
    there = np.isfinite(raw.angle)
    angle = raw.angle.copy()
    angle[there] = unwrapped(angle[there])[0]
    slope = np.gradient(angle, raw.time)
    both = np.isfinite(slope) & np.isfinite(raw.speed)
    ratio = float(slope[both] @ raw.speed[both] / (slope[both] @ slope[both]))
    for unit, of, factor in (
        ("rpm", "speed", 60 / (2 * np.pi)),
        ("deg/s", "speed", 180 / np.pi),
        ("rev/s", "speed", 0.159155),
        ("deg", "angle", np.pi / 180),
    ):
        if abs(abs(ratio) / factor - 1) < 0.15:
            raise LogError(
                f"speed is {ratio:.3g} times the slope of the angle, as if the {of} were in "
                f"{unit}: state it with --unit {of}={unit} (or is the other one in another unit?)"
            )


def usual_speed(raw: Raw, name: str) -> float | None:
    """Return the speed [rad/s] below which a motor is for 95 % of a log, by its angle or speed.

    None where there is no such signal, or somebody stated its unit.
    """
    values = getattr(raw, name)
    if values is None or name in raw.stated:
        return None
    there = np.isfinite(values)
    speed = values[there]
    if name == "angle":
        speed = np.diff(unwrapped(speed)[0]) / np.diff(raw.time[there])
    return float(np.percentile(abs(speed), 95)) if len(speed) else None


def other_units(name: str) -> str:
    """Return a question for the unit of an angle or a speed, and how to state it."""
    units = "deg or counts" if name == "angle" else "rpm or deg/s"
    return (
        f"is {name} in {units}? State it with --unit {name}=… or --scale {name}=FACTOR, or time "
        f"with --unit time=…; if all is right, with --unit {name}={SI[name]}"
    )
