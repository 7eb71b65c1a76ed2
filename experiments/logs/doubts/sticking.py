"""Sticking: a motor that stands still while its torque changes, as under much dry friction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.sketch import line, points, sketch
from flexaxis.experiments.reporting.charts import Chart

Array = NDArray[np.float64]

SLOW = 0.02  # of the rms of the speed: at random speeds, below it for 1.6 % of the time
OFTEN = 8.0  # % of the samples
PUSHED = 0.2  # of the deviation of the torque, by which it differs from its median


def _look(e: Evidence) -> Doubt | None:
    name, unit = "standing under torque", "% of the samples"
    u, v = e.torque[e.usable], e.step_speed[e.usable]
    slow = np.abs(v) < SLOW * float(np.std(v))
    moves = np.abs(v[v != 0])
    if not len(moves) or np.percentile(moves, 1) > SLOW * float(np.std(v)):
        return None  # the steps of the encoder are coarser than what is looked for
    # what only holds a load is not meant, nor is a pause without torque
    slow &= np.abs(u - np.median(u)) > PUSHED * float(np.std(u))
    share = 100 * float(slow.mean())
    if share < OFTEN:
        return Doubt(name, share, unit, "ok", "none")
    text = (
        f"the motor stands still at {share:.0f} % of the samples while its torque changes: "
        "friction holds it, and no linear model has that. Excite more, or give friction to the "
        "model"
    )
    return Doubt(
        name,
        share,
        unit,
        "problem",
        text,
        "flexaxis identify … --friction auto",
        {"friction": "auto"},
        draw=lambda: _draw(e, slow),
    )


def _draw(e: Evidence, slow: NDArray[np.bool_]) -> Chart:
    """Return the torque, and where the motor stands."""
    u = e.torque[e.usable]
    first = max(int(np.argmax(slow)) - 50, 0)
    piece = slice(first, first + 1000)
    time = np.arange(len(u))[piece] * e.period
    stands = points(time[slow[piece]], u[piece][slow[piece]], "motor stands")
    return sketch("time [s]", "torque [as logged]", line(time, u[piece]), stands)


LOOK = Look(24, _look)
