"""Dead time from torque to motion, its drift, and opposite signs."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import csd

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import SEGMENT, Evidence

Array = NDArray[np.float64]

SHIFTED = 0.75  # samples
SMALL = 0.25  # samples
NAME = "dead time from torque to angle"


def lag_of(e: Evidence, part: slice = slice(None)) -> tuple[float, float] | None:
    """Return by how much the acceleration lags the torque [samples], and the sign of its gain.

    From the phase of their cross-correlation at the upper end of the excitation, where the motor's
    own inertia is all that counts; its friction and a mode beyond that end look like a fraction
    of a sample. None where the excitation does not show it.
    """
    speed, u = e.speed[part], e.torque[part]
    a, u = np.diff(speed), u[:-1]
    length = min(len(u) // 2, round(SEGMENT / e.period))
    frequency, cross = csd(u, a, fs=1 / e.period, nperseg=length)
    low, high = e.band
    tenth = 0.1 * (high - low)
    top = (frequency > high - tenth) & (frequency <= high)
    bottom = (frequency >= low) & (frequency < low + tenth)
    if not top.any() or not bottom.any():
        return None
    centre = 2 * np.pi * float(np.mean(frequency[top]))
    # a torque over [t_k, t_{k+1}) changes the speed over that time, but the increments, which are
    # means over a sample, half a sample later
    late = 0.5 if e.incremental else 0.0
    lag = -float(np.angle(cross[top].sum())) / centre / e.period - late
    return lag, float(np.sign(cross[bottom].sum().real))


def _look(e: Evidence) -> Doubt:
    found = lag_of(e)
    if found is None:
        return Doubt(NAME, None, "samples", "note", "not visible in this excitation")
    lag, sign = found
    if sign < 0:
        text = "torque and motion have opposite signs: turn one of them"
        return Doubt(NAME, lag, "samples", "problem", text, "--scale torque=-1")
    if abs(lag) > SHIFTED:
        early = "the motor moves before its torque; " if lag < 0 else ""
        text = f"{early}a shift of one sample ruins the estimates: let identify find the delay"
        return Doubt(NAME, lag, "samples", "problem", text, "flexaxis identify (without --delay)")
    text = "less than a sample, but let identify find it" if abs(lag) > SMALL else "none to speak of"
    return Doubt(NAME, lag, "samples", "ok", text)


LOOK = Look(11, _look)
