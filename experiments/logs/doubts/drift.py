"""Drift: slow motion below the excitation that the torque does not explain."""

from __future__ import annotations

import numpy as np

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.sketch import line, sketch
from flexaxis.experiments.reporting.charts import Chart

SMALL = 5.0  # % of the rms of the speed
UNEXPLAINED = 0.5  # coherence below which the torque does not explain the motion
FLOOR = 20  # percentile of the speed's spectrum that is taken for its white noise


def _look(e: Evidence) -> Doubt | None:
    name, unit = "drift of the motion", "% of the motion"
    s, low = e.spectra, e.band[0]
    if e.corner is None:
        return Doubt(name, None, unit, "ok", "not told apart: the excitation begins too low")
    slow = (s.frequency < 0.7 * low) & (s.coherence < UNEXPLAINED)
    noise = 2 * float(np.percentile(s.speed[1:], FLOOR))
    drifting = float(np.maximum(s.speed[slow] - noise, 0).sum())
    share = 100 * float(np.sqrt(drifting / s.speed.sum()))
    if share < SMALL:
        return Doubt(name, share, unit, "ok", "small")
    text = (
        f"below {0.7 * low:.2g} Hz the angle wanders in a way that the torque does not explain: "
        "nothing holds it, or stick-slip. A filter takes both signals' slow parts away alike"
    )
    command, remedy = f"--highpass {e.corner:g}", {"highpass": e.corner}
    return Doubt(name, share, unit, "note", text, command, remedy, draw=lambda: _draw(e))


def _draw(e: Evidence) -> Chart:
    """Return the angle, and its slow part."""
    from scipy.signal import butter, sosfiltfilt

    angle = np.cumsum(e.speed) * e.period
    low = sosfiltfilt(butter(2, 2 * 0.7 * e.band[0] * e.period, output="sos"), angle)
    time = e.time - e.time[0]
    slow = line(time, low, "below the excitation")
    return sketch("time [s]", "angle [rad]", line(time, angle), slow)


LOOK = Look(21, _look)
