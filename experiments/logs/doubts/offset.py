"""An offset of the torque that the motion does not show: gravity, stiction, or a sensor.

At low frequencies an axis moves the more the lower they are, until friction alone limits it. So
a constant torque u_0 gives at least the speed G u_0, with the gain G at the low end of the
excitation. Where the motion is less than that, something holds the torque's mean that a linear
model does not know, and a simulation from the torque runs away from the log.
"""

from __future__ import annotations

import numpy as np

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.sketch import line, sketch
from flexaxis.experiments.reporting.charts import Chart

TELLS = 0.5  # coherence from which a gain is believed
SMALL = 1.0  # % of the rms of the speed: what the mean of a torque may make unseen


def low_gain(e: Evidence) -> float | None:
    """Return the gain from torque to speed at the low end of the excitation [rad/s per N m]."""
    s, (low, high) = e.spectra, e.band
    above = max(1.5 * low, low + 0.02 * (high - low))
    near = (s.frequency >= low) & (s.frequency <= above) & (s.frequency > 0)
    near &= s.torque > 1e-3 * s.torque.max()
    if not near.any() or np.mean(s.coherence[near]) < TELLS:
        return None
    return float(np.abs(s.cross[near]).sum() / s.torque[near].sum())


def _look(e: Evidence) -> Doubt | None:
    name, unit = "offset of the torque", "% of the motion"
    u, y, gain = e.torque[e.usable], e.speed[e.usable], low_gain(e)
    u0, y0, rms = float(u.mean()), float(y.mean()), float(np.std(y))
    if gain is None:
        share = 100 * abs(u0) / float(np.sqrt(np.mean(u**2)))
        return Doubt(name, share, "% of rms", "ok" if share < 5 else "note", _WORDS[share >= 5])
    moved = max(float(np.sign(u0)) * y0, 0.0)
    missing = max(gain * abs(u0) - moved, 0.0)
    # a log that begins and ends at other speeds has had a mean torque to get there
    duration = len(e.time) * e.period
    least = max(e.band[0], 1 / duration)
    ends = abs(float(e.speed[-1] - e.speed[0])) / (2 * np.pi * least * duration)
    share = 100 * max(missing - ends, 0.0) / rms
    if share < SMALL:
        return Doubt(name, share, unit, "ok", "small, or seen in the motion")
    text = (
        f"a mean of {u0:.3g} would turn the motor at {gain * u0:.2g} rad/s or more, and it turns "
        f"at {y0:.2g}: gravity, stiction or the offset of a sensor, on which a simulation of a "
        "linear axis runs away"
    )
    command, remedy = _against(e)
    return Doubt(name, share, unit, "problem", text, command, remedy, draw=lambda: _draw(e, gain))


def _against(e: Evidence) -> tuple[str, dict[str, object]]:
    if e.corner is not None:
        return f"--highpass {e.corner:g}", {"highpass": e.corner}
    return "flexaxis identify … --friction auto", {"friction": "auto"}


_WORDS = ("small", "gravity, friction or a sensor; whether the motion shows it cannot be told")


def _draw(e: Evidence, gain: float) -> Chart:
    """Return the angle, and where its mean torque would at least have taken it."""
    time = e.time - e.time[0]
    moved = np.cumsum(e.speed) * e.period
    due = line(time, gain * float(e.torque.mean()) * time, "from the mean torque")
    return sketch("time [s]", "angle [rad]", line(time, moved), due)


LOOK = Look(20, _look)
