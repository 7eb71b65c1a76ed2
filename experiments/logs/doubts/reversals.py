"""Reversals and the span of speeds: what laws of friction need to be told apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.sketch import histogram, sketch
from flexaxis.experiments.reporting.charts import Chart

Array = NDArray[np.float64]

FEW = 10  # reversals
WIDE = 5.0  # of the upper quartile of the speed over the lower


def reversals_of(e: Evidence) -> tuple[int, float]:
    """Return the number of reversals, and the ratio of fast to slow speeds (deciles)."""
    v = e.step_speed[e.usable]
    # a reversal that noise makes about standstill is none: a tenth of the rms must be crossed
    out = v[np.abs(v) > 0.1 * float(np.std(v))]
    slow, fast = np.percentile(np.abs(v), [10, 90])
    return int(np.sum(np.diff(np.sign(out)) != 0)), float(fast / max(slow, 1e-12 * fast + 1e-300))


def _look(e: Evidence) -> Doubt:
    name, v = "reversals of the motion", e.step_speed[e.usable]
    reversals, span = reversals_of(e)
    slow, fast = np.percentile(np.abs(v), [10, 90])
    duration = len(e.time) * e.period
    text = (
        f"{reversals / duration:.2g} a second; 80 % of the speeds within {slow:.2g} … {fast:.2g} "
        "rad/s"
    )
    if reversals >= FEW and span >= WIDE:
        return Doubt(name, float(reversals), "", "ok", text)
    few = "there are few reversals" if reversals < FEW else "the speeds are nearly the same"
    text += (
        f"; {few}: dry and viscous friction can hardly be told apart. Log motions to and fro at "
        "several speeds"
    )
    return Doubt(name, float(reversals), "", "note", text, draw=lambda: _draw(v))


def _draw(v: Array) -> Chart:
    counted = histogram(v, bins=80)
    return sketch("motor speed [rad/s]", "samples", counted, marks=[(0.0, "")])


LOOK = Look(23, _look)
