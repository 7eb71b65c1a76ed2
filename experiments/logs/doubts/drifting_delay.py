"""A delay that drifts: torque and motion are stamped by two clocks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.doubts.dead_time import lag_of
from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.sketch import line, sketch
from flexaxis.experiments.reporting.charts import Chart

PIECES = 6  # of the log, over which the delay must stay
LEAST = 1000  # samples in a piece
DRIFTS = 0.4  # samples over the log
CLEAR = 5.0  # standard deviations


def _look(e: Evidence) -> Doubt | None:
    length = len(e.time) // PIECES
    if length < LEAST:
        return None
    lags = []
    for k in range(PIECES):
        found = lag_of(e, slice(k * length, (k + 1) * length))
        if found is None or found.opposite:
            return None
        lags.append(found.samples)
    middle = (np.arange(PIECES) - (PIECES - 1) / 2) / PIECES
    slope = float(middle @ lags / (middle @ middle))
    rest = np.asarray(lags) - np.mean(lags) - slope * middle
    sd = float(np.sqrt(rest @ rest / (PIECES - 2) / (middle @ middle)))
    name = "drift of the dead time"
    if abs(slope) < max(DRIFTS, CLEAR * sd):
        return Doubt(name, slope, "samples", "ok", "none")
    text = (
        f"from {lags[0]:.2g} to {lags[-1]:.2g} samples over the log: torque and motion run on two "
        "clocks. Log both by one, or use pieces so short that the delay stays"
    )
    return Doubt(
        name,
        slope,
        "samples",
        "problem",
        text,
        draw=lambda: _draw(e.time, length, lags),
    )


def _draw(time: NDArray[np.float64], length: int, lags: list[float]) -> Chart:
    middle = [time[k * length + length // 2] for k in range(PIECES)]
    return sketch("time [s]", "dead time [samples]", line(middle, lags, kind="both"))


LOOK = Look(12, _look)
