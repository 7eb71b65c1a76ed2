"""Two clocks: a signal that is updated less often than the log has samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.resolution import step_of
from flexaxis.experiments.logs.doubts.sketch import line, sketch
from flexaxis.experiments.reporting.charts import Chart

Array = NDArray[np.float64]

REGULAR = 0.8  # of the updates that come after the usual number of samples
MOVING = 3.0  # steps of its resolution by which a signal moves between its updates
LONGEST = 200_000  # samples that are looked at


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
    usual = round(float(np.median(gaps)))
    step = step_of(values)
    jumps = np.abs(values[changes + 1] - values[changes])
    coarse = step is not None and float(np.median(jumps)) < MOVING * step
    regular = float(np.mean(np.isin(gaps % usual, (0,)))) if usual > 1 else 0.0
    return usual if usual > 1 and regular > REGULAR and not coarse else 1


def _look(e: Evidence) -> Doubt | None:
    if e.raw is None:
        return None
    signals = {name: getattr(e.raw, name) for name in ("torque", "angle", "speed")}
    every = {name: updates_every(v) for name, v in signals.items() if v is not None}
    name, motion = "clocks", {n: k for n, k in every.items() if n != "torque"}
    slowest = max(motion.values())
    if e.raw.joined:
        text = f"{e.raw.joined}: signals of two topics, of which the delay is not known"
        command = "flexaxis identify, without --delay"
        return Doubt(name, None, "samples", "note", text, command)
    if slowest == 1 and every["torque"] == 1:
        return Doubt(name, 1.0, "samples", "ok", "all signals are updated at each sample")
    text = ", ".join(f"{n} at every {'' if k == 1 else f'{k}. '}sample" for n, k in every.items())
    if slowest == 1:  # a torque that is held for longer than a sample is no harm
        return Doubt(name, float(every["torque"]), "samples", "ok", f"updated: {text}")
    text = (
        f"updated: {text}. What is repeated is late by up to {slowest - 1} samples: log both by "
        "one clock, or bring the log to the slower rate"
    )
    command = f"--resample {1 / e.period / slowest:.6g}"
    return Doubt(
        name,
        float(slowest),
        "samples",
        "problem",
        text,
        command,
        draw=lambda: _draw(e),
    )


def _draw(e: Evidence) -> Chart:
    assert e.raw is not None
    values, label = e.raw.angle, "angle [rad]"
    if values is None:
        values, label = np.asarray(e.raw.speed), "speed [rad/s]"
    middle = len(values) // 2
    piece = values[middle : middle + 60]
    k = np.arange(middle, middle + len(piece))
    return sketch("sample", label, line(k, piece, kind="steps"))


LOOK = Look(6, _look)
