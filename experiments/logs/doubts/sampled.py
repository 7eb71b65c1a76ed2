"""How a log was sampled: time stamps and gaps, wrapping, clipping, clocks, units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.nonsense import FAST, SI, other_units, usual_speed
from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.logs.pages.page import LOG, line, points, sketch
from flexaxis.experiments.reporting.charts import Chart, Line

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

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
    jitter = 0.0 if e.prepared is None else 100 * e.prepared.jitter
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
        return Finding("note", text, name, missing, "% missing", rate, lambda: _steps(e))
    if not missing:
        return Finding("ok", text, name, 0.0, "% missing")
    kind = "note" if missing < MISSING else "problem"
    return Finding(kind, text, name, missing, "% missing", draw=lambda: _there(e))  # type: ignore[arg-type]


def _infinite(e: Evidence) -> str:
    """Return in words which signals of a log have infinite values, and how many."""
    there = {n: getattr(e.raw, n, None) for n in ("torque", "angle", "speed", "load_angle")}
    counts = {n: int(np.isinf(values).sum()) for n, values in there.items() if values is not None}
    return ", ".join(
        f"{n} in {count} sample{'s' * (count > 1)}" for n, count in counts.items() if count
    )


def _steps(e: Evidence) -> Chart:
    """Return how long the samples were, by their stamps."""
    assert e.raw is not None
    steps, period = 1e3 * np.diff(e.raw.time), 1e3 * e.period
    counts, edges = np.histogram(steps[steps < 3 * period], bins=60)
    shown = Line(who=LOG, x=edges, y=np.append(counts, 0.0), kind="steps")
    return sketch("from one stamp to the next [ms]", "samples", shown, marks=[(period, "period")])


def _there(e: Evidence) -> Chart:
    missing = ~e.usable
    edges = np.unique(np.r_[0, np.flatnonzero(np.diff(missing)) + 1, len(missing) - 1])
    steps = Line(who=LOG, x=np.asarray(e.time)[edges], y=1.0 * missing[edges], kind="steps")
    return sketch("time [s]", "missing (1) or there (0) [-]", steps)


def wrapping(e: Evidence) -> Finding | None:
    """Return where turns were added, and where it cannot be told how many."""
    if e.prepared is None or e.raw is None or e.raw.angle is None:
        return None
    raw, name, wrap = e.raw.angle, "wrapping of the angle", e.prepared.wrap
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
    first = max(int(np.argmax(np.abs(np.diff(raw)) > np.pi)) - 20, 0)
    k = np.arange(len(raw))[first : first + 60]
    return Finding(
        "problem", text, name, float(wrap.jumps), "jumps", command,
        lambda: sketch("sample", "angle as logged [rad]", line(k, raw[k], kind="both")),
    )  # fmt: skip


def clipping(e: Evidence) -> Finding | None:
    """Return whether the torque stands at its extreme value."""
    if e.told("highpass") or (e.raw is None and e.smooth):
        return None  # a filter has blurred what stood still
    u = e.torque if e.raw is None else e.raw.torque
    u = u[np.isfinite(u)]
    name, stuck = "clipping of the torque", at_limit(u)
    share = 100 * float(stuck.mean())
    if share == 0 or len(np.unique(u[:10_000])) <= LEVELS:
        return Finding("ok", "none", name, 0.0, "%")
    text = (
        f"the torque stands at its limit, {np.abs(u).max():.4g}: harmless if that is what acted; "
        "if it is what was asked for, or the sensor's end, log what acted, or excite less"
    )
    first = max(int(np.argmax(stuck)) - 100, 0)
    k = np.arange(len(u))[first : first + 400]
    at = points(k[stuck[k]], u[k][stuck[k]], "at its extreme")

    def draw() -> Chart:
        return sketch("sample", "torque [as logged]", line(k, u[k]), at)

    kind = "note" if share < CLIPPED else "problem"
    return Finding(kind, text, name, share, "%", draw=draw)  # type: ignore[arg-type]


def at_limit(u: Array) -> Flags:
    """Return where a signal stands at its highest or lowest value for three or more samples."""
    stuck = np.zeros(len(u), bool)
    for extreme in (u.max(), u.min()):
        run = np.convolve(u == extreme, np.ones(RUN), "valid") > RUN - 0.5
        for shift in range(RUN):
            stuck[shift : len(u) - RUN + 1 + shift] |= run
    return stuck


def clocks(e: Evidence) -> Finding | None:
    """Return which signals are updated less often than the log has samples."""
    if e.raw is None:
        return None
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
    values = e.raw.angle if e.raw.angle is not None else np.asarray(e.raw.speed)
    k = np.arange(len(values))[len(values) // 2 : len(values) // 2 + 60]
    return Finding(
        "problem", text, name, float(slowest), "samples", command,
        lambda: sketch("sample", "motion [as logged]", line(k, values[k], kind="steps")),
    )  # fmt: skip


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


def units(e: Evidence) -> Finding | None:
    """Return which units were stated, and which were taken for granted."""
    if e.raw is None:
        return None
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
