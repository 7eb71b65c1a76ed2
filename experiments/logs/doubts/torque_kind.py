"""Whether the torque of a log is a command that is held, or a measured current that is smooth.

A command jumps at each sample and stays; what is logged of it acts. A measured current goes on
changing between samples, passes the filters of its amplifier, and has noise of its sensor on it,
which does not move the motor. To take one for the other is half a sample of delay.
"""

from __future__ import annotations

import re
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import welch

from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.logs.findings import Kind as Weight
from flexaxis.experiments.logs.spectra import spectra

Array = NDArray[np.float64]
Kind = Literal["held", "smooth"]

SWITCHES = 3  # values, of which no sensor has so few
SPOTLESS = 1e-9  # of its power in noise: no sensor is so good
STANDS = 0.5  # of the samples that equal the one before
SHORT = 256  # samples in a piece, for the coherence
MOVES, MOVES_NOT = 0.5, 0.3  # of the coherence that a torque which acts would have
EXPECTED = 0.1  # coherence below which nothing can be told from its absence
LONGEST = 500_000  # samples that are looked at

GIVEN = "as stated"
"""The reason of a kind that somebody stated."""
AGAINST = f"{GIVEN}, but"
"""How the reason begins where the signals speak against that."""
UNSEEN = "its samples do not tell"
_WORDS = {"held": "a command", "smooth": "a measured current"}

_MEASURED = re.compile(r"meas|actual|\bact\b|_act|current|_ad|feedback|\bi_?q\b|effort", re.I)
_COMMAND = re.compile(r"ref|cmd|command|set|desired|demand|target", re.I)


def torque_kind(
    torque: ArrayLike, period: float, *, speed: ArrayLike | None = None, name: str = ""
) -> tuple[Kind, str]:
    """Return whether a torque is held or smooth between its samples, and how that was seen.

    Parameters
    ----------
    torque : (N,) array_like
        Samples, not means.
    period : float
        [s].
    speed : (N,) array_like, optional
        Motor speed at the same samples, by which the noise of a sensor is told from a torque
        that acts.
    name : str
        Of its column, which is believed where the signals do not tell.

    Examples
    --------
    >>> import numpy as np
    >>> torque_kind(np.sign(np.random.default_rng(0).standard_normal(1000)), 0.001)[0]
    'held'
    """
    seen = kind_seen(torque, period, speed=speed)
    if seen:
        return seen
    if _COMMAND.search(name):
        return "held", f"{UNSEEN}, but its column is called {name}"
    if _MEASURED.search(name):
        return "smooth", f"{UNSEEN}, but its column is called {name}"
    return "held", f"{UNSEEN}; taken for a command"


def kind_seen(
    torque: ArrayLike, period: float, *, speed: ArrayLike | None = None
) -> tuple[Kind, str] | None:
    """Return what the signals alone tell of the kind of a torque; None where they do not."""
    u = np.asarray(torque, float)[:LONGEST]
    by_shape = _by_shape(u, period)
    if by_shape:
        return "held", by_shape
    if speed is None:
        return None
    return _by_motion(u, np.asarray(speed, float)[:LONGEST], period)


def _by_shape(u: Array, period: float) -> str:
    """Return why a torque must be a command, or nothing."""
    if len(np.unique(u)) <= SWITCHES:
        return "it switches between few values"
    same = np.diff(u) == 0
    if same.mean() > STANDS and np.abs(np.diff(u)).max() > 0.1 * np.ptp(u):
        return f"it stands still at {100 * same.mean():.0f} % of the samples, and jumps between"
    frequency, power = welch(
        u, fs=1 / period, nperseg=min(len(u) // 2, 4096), window="blackmanharris"
    )
    share = power / power.sum()
    floor = float(np.median(share[frequency > 0.4 / period]) * len(share))
    if floor < SPOTLESS:
        return "it has no noise on it, as what was computed"
    return ""


def _by_motion(u: Array, speed: Array, period: float) -> tuple[Kind, str] | None:
    """Tell by whether its fastest parts, above a quarter of the rate, move the motor."""
    a, u = np.diff(speed) / period, u[:-1]
    length = min(SHORT, len(u) // 16)
    s = spectra(u, a, period, length=length)
    fast, band = s.frequency > 0.25 / period, s.torque > 0.01 * s.torque.max()
    # of white noise, the coherence of averages over overlapping pieces
    seen = float(np.mean(s.coherence[fast])) - length / len(u)
    gain = float(np.median(np.abs(s.cross[band]) / s.torque[band]))
    due = gain**2 * s.torque[fast].sum() / s.motion[fast].sum()
    expected = min(float(due), 1.0)
    if seen > MOVES:
        return "held", "its fastest parts move the motor, or come from its motion sample by sample"
    if expected > EXPECTED and seen < MOVES_NOT * expected:
        text = "its fastest parts are noise of a sensor: they do not move the motor"
        return "smooth", text
    return None


def look(e: Evidence) -> Finding:
    """Return how the torque was taken between its samples, and why."""
    name, kind = "torque between samples", "smooth" if e.smooth else "held"
    other, because = "held" if e.smooth else "smooth", e.told("torque_because")
    text = f"{kind}: {because}" if because else kind
    against, unseen = AGAINST in because, UNSEEN in because
    if not (against or unseen):
        return Finding("ok", text, name)
    if unseen:
        text += f". If it is {_WORDS[other]}, say so: half a sample of delay depends on it"
    weight: Weight = "problem" if against else "note"
    return Finding(weight, text, name, command=f"--torque-is {other}")
