"""Jitter: time stamps beside an even grid."""

from __future__ import annotations

import numpy as np

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.sketch import histogram, sketch
from flexaxis.experiments.reporting.charts import Chart

MUCH = 5.0  # % of a period


def _look(e: Evidence) -> Doubt | None:
    if e.prepared is None:
        return None
    name, percent = "jitter of the time stamps", 100 * e.prepared.jitter
    if percent < MUCH:
        return Doubt(name, percent, "% of T", "ok", "even")
    text = (
        "signals were interpolated; stamps from the controller would be better. If the samples "
        "were taken evenly and only their stamps are late, give the rate in place of the time"
    )
    rate = f"{1 / e.period:.6g}"
    return Doubt(name, percent, "% of T", "note", text, f"--rate {rate}", draw=lambda: _draw(e))


def _draw(e: Evidence) -> Chart:
    """Return how long the samples were, by their stamps."""
    assert e.raw is not None
    steps, period = 1e3 * np.diff(e.raw.time), 1e3 * e.period
    counted = histogram(steps[steps < 3 * period], bins=60)
    x = "from one stamp to the next [ms]"
    return sketch(x, "samples", counted, marks=[(period, "period")])


LOOK = Look(1, _look)
