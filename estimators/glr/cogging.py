"""
Search for unknown cogging, a torque that is periodic in the motor angle, during initialisation.

A motor torque c B(φ) that the model does not contain changes the error of the filter by c δ. For a
jump, δ starts as a unit vector (`flexaxis.estimators.glr.bank`). For cogging, δ starts at zero, and
every sample adds the effect of the torque B: δ ← F δ − K φ + Γ B. J and d of a column therefore
determine the coefficient c and its evidence. The functions B are the sine and cosine of each whole
number of waves per revolution, which are uncorrelated over many revolutions. If the evidence of the
strongest wave is sufficient, a filter that includes this wave as a cogging law continues from the
current state.
"""

from typing import NamedTuple

import numpy as np

from flexaxis.estimators.glr.bank import Columns
from flexaxis.estimators.models.compiler import fused, inlined
from flexaxis.estimators.models.memory import Memory, Vector
from flexaxis.estimators.models.rows import multiply

ALARM = 20.0  # nats, smallest evidence of an accepted wave. The value is three times that of a
# jump, because a wave is never removed and friction that is not learnt yet makes columns wrong
UNKNOWN = 3  # unknowns of a wave: two coefficients, and the number of waves per revolution
FASTEST = 2.0  # radians, largest phase advance of a wave per sample at the rms speed; the torque of
# a faster wave averages out within a sample


class Waves(NamedTuple):
    """
    Sine and cosine of K waves, the torques that are tested for cogging.

    Attributes
    ----------
    columns : Columns
        One column for each sine and each cosine.
    pull : (2K,) array
        Value of each sine and cosine in the last sample.
    """

    columns: Columns
    pull: Vector


@inlined
def look_for_waves(b, pull, now, axis):
    """Update the motor angle, and store the sine and cosine of each wave in the last sample."""
    speed, read = axis.lanes[1, 0, 0], now["prediction"]  # mean speed of friction, the first law
    if not np.isnan(now["innovation"]):  # the angle of a wrong model would soon be wrong
        read += now["innovation"]
    b["angle"] += b["period"] * (b["mean_speed"][0] * read + b["mean_speed"][1] * b["read"])
    b["read"] = read
    angle = b["angle"] + 0.5 * b["period"] * speed
    sine, cosine, s, c = 0.0, 1.0, np.sin(angle), np.cos(angle)
    for k in range(len(pull) // 2):
        sine, cosine = sine * c + cosine * s, cosine * c - sine * s
        pull[2 * k], pull[2 * k + 1] = sine, cosine


@fused
def carry_waves(waves, axis, G):
    """Propagate the columns over the last sample, and add the effect of the torques."""
    moved, pull, response = waves.columns.moved, waves.pull, axis.response
    multiply(G, waves.columns.D, moved)
    for i in range(len(moved)):  # response to friction, with the opposite sign
        k = i if i < len(moved) - 1 else response.shape[1] - 1
        push = -response[0, k, 0] * axis.sizes[0]["steps"]
        for c in range(len(pull)):
            moved[i, c] += push * pull[c]


@inlined
def begin_waves(b, waves):
    """Restart the search for waves when the axis starts to move."""
    waves.columns.D[:] = 0.0
    b["angle"] = b["read"] = 0.0
    begin_sums(b, waves)


@inlined
def begin_sums(b, waves):
    """Set all evidence to zero, to exclude the large innovations of the first samples."""
    waves.columns.J[:] = 0.0
    waves.columns.d[:] = 0.0
    b["repeated"] = b["z_before"] = b["chi2"] = b["used"] = 0.0


def strongest_wave(bank: Memory, variance: float) -> tuple[int, float, float] | None:
    """
    Return the wave that best explains the initialisation data, with its two coefficients.

    A wave reduces the sum χ² of e²/S over n samples by Δ. Because the scale of χ² is unknown, the
    evidence is ½ n ln(χ²/(χ² − Δ)). The evidence is reduced by ½ ln n for each unknown, and by the
    logarithm of the number of waves. If ρ is the correlation of successive innovations without the
    wave, (1+ρ)/(1−ρ) samples count as one. The explained part is treated as fully correlated.

    Parameters
    ----------
    bank : Memory
        Memory of the filter after initialisation.
    variance : float
        Prior variance of the coefficients [(N m)²].

    Returns
    -------
    (waves, sine, cosine) or None
        Number of waves per revolution, and coefficients [N m]; None if no wave has enough evidence.
    """
    chi2, used, waves = float(bank["chi2"]), float(bank["used"]), len(bank["pull"]) // 2
    if not waves or used < UNKNOWN or not chi2 > 0:
        return None
    J, d = (bank[name].reshape(waves, 2) for name in ("wave_J", "wave_d"))
    size = d / (J + max(1.0, chi2 / used) / variance)
    explained = np.minimum((size * d).sum(axis=1), (1 - 1 / used) * chi2)
    left = chi2 - explained
    rho = np.clip((bank["repeated"] - explained) / left, 0.0, 0.95)
    n = used * (1 - rho) / (1 + rho)
    gain = 0.5 * n * np.log(chi2 / left) - 0.5 * UNKNOWN * np.log(n) - np.log(waves)
    best = int(np.argmax(gain))
    return (best + 1, *size[best].tolist()) if gain[best] > ALARM else None
