"""Dead time from torque to motion, and opposite signs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import csd

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import SEGMENT, Evidence
from flexaxis.experiments.logs.doubts.sketch import LOG, line, points, sketch
from flexaxis.experiments.reporting.charts import Chart

Array = NDArray[np.float64]

SHIFTED = 0.75  # samples
SMALL = 0.25  # samples
NEAR_WRAP = 2.0  # rad, from which on a phase may be one turn further
FAST = 0.5  # rad that the fastest excitation turns by in a sample: below, a lead tells nothing
NAME = "dead time from torque to angle"


class Lag(NamedTuple):
    """Samples by which the acceleration lags the torque.

    Attributes
    ----------
    samples : float
    turn : float
        What the excitation at which it was seen turns by in a sample [rad].
    opposite : bool
        Whether torque and motion have opposite signs.
    """

    samples: float
    turn: float
    opposite: bool


def lag_of(e: Evidence, part: slice = slice(None)) -> Lag | None:
    """Return by how much the acceleration lags the torque; None if the excitation hides it.

    From the phase of their cross-correlation at the upper end of the excitation, where the motor's
    own inertia is all that counts; its friction and a mode beyond that end look like a fraction
    of a sample. Friction and modes of any passive axis make the acceleration lead, never lag.
    """
    speed, u = e.speed[part], e.torque[part]
    a, u = np.diff(speed), u[:-1]
    length = min(len(u) // 2, round(SEGMENT / e.period))
    frequency, cross = csd(u, a, fs=1 / e.period, nperseg=length)
    low, high = e.band
    tenth = 0.1 * (high - low)
    top = (frequency > high - tenth) & (frequency <= high)
    bottom = (frequency >= low) & (frequency < low + tenth) & (frequency > 0)
    if not top.any() or not bottom.any():
        return None
    turn = 2 * np.pi * float(np.mean(frequency[top])) * e.period
    phase = float(np.angle(cross[top].sum()))
    if abs(phase) > NEAR_WRAP:  # half the frequency has half the phase, which tells the turn
        middle = (frequency > high / 2 - tenth) & (frequency <= high / 2) & (frequency >= low)
        double = 2 * float(np.angle(cross[middle].sum()))
        phase += 2 * np.pi * round((double - phase) / (2 * np.pi))
    # a torque over [t_k, t_{k+1}) changes the speed over that time, but the increments, which are
    # means over a sample, half a sample later
    late = 0.5 if e.incremental else 0.0
    # at low frequencies an axis is inertia and friction: its acceleration leads by 0 to 90°
    opposite = float((cross[bottom] * np.exp(-0.25j * np.pi)).sum().real) < 0
    return Lag(-phase / turn - late, turn, opposite)


def _look(e: Evidence) -> Doubt:
    found = lag_of(e)
    if found is None:
        return Doubt(NAME, None, "samples", "note", "not visible in this excitation")
    lag = found.samples

    def draw() -> Chart:
        return _draw(e)

    if found.opposite:
        text = "torque and motion have opposite signs: turn one of them"
        remedy = "--scale torque=-1"
        return Doubt(NAME, lag, "samples", "problem", text, remedy, draw=draw)
    if lag < -SMALL and found.turn < FAST:
        return Doubt(NAME, None, "samples", "ok", "not seen: the excitation is too slow for it")
    if abs(lag) > SHIFTED:
        early = "the motor moves before its torque; " if lag < 0 else ""
        text = f"{early}a shift of one sample ruins the estimates: let identify find the delay"
        return Doubt(
            NAME, lag, "samples", "problem", text, "flexaxis identify, without --delay", draw=draw
        )
    text = (
        "less than a sample, but let identify find it" if abs(lag) > SMALL else "none to speak of"
    )
    return Doubt(NAME, lag, "samples", "ok", text)


def _draw(e: Evidence) -> Chart:
    """Return the phase from torque to acceleration, and that of one sample."""
    s, (low, high) = e.spectra, e.band
    band = (s.frequency >= low) & (s.frequency <= high)
    f = s.frequency[band]
    turn = np.pi * f * e.period
    late = turn if e.incremental else np.zeros_like(f)
    phase = np.angle(s.cross[band] * 1j * np.exp(1j * (turn + late)))
    due = line(f, -np.degrees(2 * turn), "one sample late")
    seen = points(f, np.degrees(phase), LOG)
    return sketch("frequency [Hz]", "torque to acceleration [°]", seen, due)


LOOK = Look(11, _look)
