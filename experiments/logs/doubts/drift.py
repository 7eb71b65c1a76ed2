"""Drift: slow motion below the excitation that the torque does not explain."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexaxis.experiments.logs.doubts.doubt import BLUE, ORANGE, Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
    return Doubt(name, share, unit, "note", text, command, remedy, draw=lambda axes: _draw(axes, e))


def _draw(axes: Axes, e: Evidence) -> None:
    """Draw the angle, and its slow part."""
    from scipy.signal import butter, sosfiltfilt

    angle = np.cumsum(e.speed) * e.period
    low = sosfiltfilt(butter(2, 2 * 0.7 * e.band[0] * e.period, output="sos"), angle)
    step = max(len(angle) // 4000, 1)
    time = e.time[::step] - e.time[0]
    axes.plot(time, angle[::step], color=BLUE, lw=0.5, label="angle")
    axes.plot(time, low[::step], color=ORANGE, lw=1.2, label="below the excitation")
    axes.set(xlabel="time [s]", ylabel="angle [rad]")
    axes.legend(frameon=False)


LOOK = Look(21, _look)
