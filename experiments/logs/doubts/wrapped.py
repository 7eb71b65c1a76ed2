"""Wrapped angles: where turns were added, and where it cannot be told how many."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.sketch import line, sketch
from flexaxis.experiments.reporting.charts import Chart

Array = NDArray[np.float64]

FAST = 0.35  # of a turn a sample: beyond half of one, the direction cannot be told


def _look(e: Evidence) -> Doubt | None:
    if e.prepared is None or e.raw is None or e.raw.angle is None:
        return None
    raw = e.raw.angle
    name, wrap = "wrapping of the angle", e.prepared.wrap
    if not wrap.turn:
        return Doubt(name, 0.0, "jumps", "ok", "none: the angle is not confined to one turn")
    text = f"unwrapped at {wrap.jumps} samples, by {wrap.turn:.6g} rad each"
    if wrap.fastest < FAST:
        return Doubt(name, float(wrap.jumps), "jumps", "ok", text)
    text += (
        f"; it moves by up to {wrap.fastest:.2g} of a turn in a sample, and beyond half a turn "
        "the direction is a guess: log the angle without wrapping or faster, or use the speed"
    )
    command = "--speed COLUMN in place of --angle"
    return Doubt(
        name,
        float(wrap.jumps),
        "jumps",
        "problem",
        text,
        command,
        draw=lambda: _draw(raw),
    )


def _draw(angle: Array) -> Chart:
    first = max(int(np.argmax(np.abs(np.diff(angle)) > np.pi)) - 20, 0)
    piece = slice(first, first + 60)
    k = np.arange(len(angle))[piece]
    return sketch("sample", "angle as logged [rad]", line(k, angle[piece], kind="both"))


LOOK = Look(3, _look)
