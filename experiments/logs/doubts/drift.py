"""Drift: slow motion below the excitation that the torque does not explain."""

import numpy as np

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence

SMALL = 10.0  # % of the rms of the angle


def _look(e: Evidence) -> Doubt | None:
    name, unit = "drift of the angle", "% of the motion"
    s, low = e.spectra, e.band[0]
    f = s.frequency
    if e.corner is None:
        return Doubt(name, None, unit, "ok", "not told apart: the excitation begins too low")
    seen = f > 0
    angle = np.zeros_like(f)
    angle[seen] = s.speed[seen] / f[seen] ** 2  # power of the angle, but for a factor
    slow = seen & (f < 0.7 * low)
    unexplained = float((angle * (1 - s.coherence))[slow].sum())
    share = 100 * float(np.sqrt(unexplained / angle[seen].sum()))
    if share < SMALL:
        return Doubt(name, share, unit, "ok", "small")
    text = (
        f"below {0.7 * low:.2g} Hz the angle wanders in a way that the torque does not explain: "
        "nothing holds it, or stick-slip. A filter takes both signals' slow parts away alike"
    )
    command, remedy = f"--highpass {e.corner:g}", {"highpass": e.corner}
    return Doubt(name, share, unit, "note", text, command, remedy, draw=lambda axes: _draw(axes, e))


def _draw(axes, e) -> None:  # type: ignore[no-untyped-def]
    """Draw the angle, and its slow part."""
    from scipy.signal import butter, sosfiltfilt

    angle = np.cumsum(e.speed) * e.period
    low = sosfiltfilt(butter(2, 2 * 0.7 * e.band[0] * e.period, output="sos"), angle)
    step = max(len(angle) // 4000, 1)
    time = e.time[::step] - e.time[0]
    axes.plot(time, angle[::step], color="#0072B2", lw=0.5, label="angle")
    axes.plot(time, low[::step], color="#D55E00", lw=1.2, label="below the excitation")
    axes.set(xlabel="time [s]", ylabel="angle [rad]")
    axes.legend(frameon=False)


LOOK = Look(21, _look)
