"""Resolution: steps of the encoder and of the current."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.sketch import line, sketch
from flexaxis.experiments.reporting.charts import Chart

Array = NDArray[np.float64]

COARSE = 0.1  # of the rms of the speed that its steps may make in noise
LONGEST = 200_000  # samples that are looked at


def step_of(values: Array) -> float | None:
    """Return the step of which a signal is made; None if it is finer than its changes."""
    values = values[np.isfinite(values)][:LONGEST]
    steps, span = np.abs(np.diff(values)), float(np.ptp(values))
    moved = steps[steps > 1e-9 * span]
    if not len(moved):
        return None
    smallest = float(np.percentile(moved, 1))
    multiples = moved / smallest
    whole = np.mean(np.abs(multiples - np.rint(multiples)) < 0.05)
    # steps without a quantum lie within .05 of a whole number in a tenth of the cases
    return smallest if whole > 0.9 else None


def _look(e: Evidence) -> Doubt | None:
    angle = e.angle if e.raw is None else e.raw.angle
    if angle is None or (e.highpass and e.raw is None):
        return None
    name, step = "encoder resolution", step_of(angle)
    if step is None:
        return Doubt(name, None, "rad", "ok", "finer than the motion shows")
    noise = step / np.sqrt(6) / e.period  # of the difference of two angles, each ± half a step
    share = noise / float(np.std(e.speed))
    text = f"{2 * np.pi / step:.6g} steps a turn, {noise:.2g} rad/s of noise in increments"
    if share < COARSE:
        return Doubt(name, step, "rad", "ok", text)
    _, high = e.band
    rate = max(10 * high, 50.0)
    text += f", {100 * share:.0f} % of the motion: move faster, or resample"
    if rate > 0.5 / e.period:
        return Doubt(name, step, "rad", "note", text)
    command = f"--resample {rate:.0f}"
    return Doubt(name, step, "rad", "note", text, command, draw=lambda: _draw(angle))


def _draw(angle: Array) -> Chart:
    middle = len(angle) // 2
    piece = angle[middle : middle + 200]
    k = np.arange(middle, middle + len(piece))
    return sketch("sample", "angle [rad]", line(k, piece, kind="steps"))


LOOK = Look(5, _look)
