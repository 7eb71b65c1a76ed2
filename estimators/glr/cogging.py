"""
Search for an unknown cogging torque, which is periodic in the motor angle.

The search for cogging takes place during the initialisation of the estimator. If the model lacks a
motor torque with the waveform B and the coefficient c, the estimation error of the filter changes
by c δ. For a parameter jump, the vector δ starts as a unit vector (`flexaxis.estimators.glr.bank`).
For cogging, the vector δ starts at zero. Each sample adds the effect Γ B of the torque, so the
recursion is δ ← F δ − K φ + Γ B. As for a parameter jump, an information sum J and a score sum d
determine the size of the torque and the evidence for it. For each integer number of waves per
revolution, the search tests a sine and a cosine torque. Over many revolutions, the sines and
cosines of different waves are uncorrelated. If the evidence for the strongest wave is sufficient,
the estimator switches to a filter whose model includes this wave. The new filter starts from the
current state.
"""

from typing import NamedTuple

import numpy as np

from flexaxis.estimators.glr.bank import Columns
from flexaxis.estimators.models.compiler import fused, inlined
from flexaxis.estimators.models.matrix_rows import multiply
from flexaxis.estimators.models.memory import Memory, Vector

ALARM = 20.0  # nats, smallest evidence of an accepted wave. The value is three times that of a
# jump, because a wave is never removed and friction that is not learnt yet makes columns wrong
UNKNOWN = 3  # unknowns of a wave: two coefficients, and the number of waves per revolution
FASTEST = 2.0  # radians, largest phase advance of a wave per sample at the rms speed; the torque of
# a faster wave averages out within a sample


class Waves(NamedTuple):
    """
    Sines and cosines of K waves, which are the torques that the cogging search tests.

    Attributes
    ----------
    columns : Columns
        One column δ for the sine of each wave, and one column δ for the cosine.
    pull : (2K,) array
        Values of the sines and cosines of all waves in the last sample.
    """

    columns: Columns
    pull: Vector


@inlined
def look_for_waves(b, pull, now, axis):
    """Update the motor angle, and store the sine and cosine of each wave at the new angle."""
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
    """Propagate the columns δ of all waves by one sample, and add the effects of the waves."""
    moved, pull, response = waves.columns.moved, waves.pull, axis.response
    multiply(G, waves.columns.D, moved)
    for i in range(len(moved)):  # response to friction, with the opposite sign
        k = i if i < len(moved) - 1 else response.shape[1] - 1
        push = -response[0, k, 0] * axis.sizes[0]["steps"]
        for c in range(len(pull)):
            moved[i, c] += push * pull[c]


@inlined
def begin_waves(b, waves):
    """Restart the search for cogging waves when the axis starts to move."""
    waves.columns.D[:] = 0.0
    b["angle"] = b["read"] = 0.0
    begin_sums(b, waves)


@inlined
def begin_sums(b, waves):
    """Reset the evidence for all waves, to exclude the large innovations of the first samples."""
    waves.columns.J[:] = 0.0
    waves.columns.d[:] = 0.0
    b["repeated"] = b["z_before"] = b["chi2"] = b["used"] = 0.0


def strongest_wave(bank: Memory, variance: float) -> tuple[int, float, float] | None:
    """
    Return the cogging wave that fits the initialisation data best, with its two coefficients.

    Let χ² be the sum of e²/S over n samples, and let Δ be the decrease of χ² due to a wave. Because
    the noise level is unknown, the evidence for a wave that reduces χ² by Δ is ½ n ln(χ²/(χ² − Δ)).
    The evidence for a wave is reduced by ½ ln n for each unknown of the wave, and by the logarithm
    of the number of tested waves. If successive innovations have a correlation ρ after the wave has
    been subtracted, the number n of samples is divided by (1+ρ)/(1−ρ). The computation of ρ assumes
    that the wave's contribution to the innovations is fully correlated from one sample to the next.

    Parameters
    ----------
    bank : Memory
        Memory of the hypothesis bank after the first pass over the initialisation data.
    variance : float
        Prior variance of the two wave coefficients [(N m)²].

    Returns
    -------
    (waves, sine, cosine) or None
        Number of waves per revolution and the two wave coefficients [N m], or None if the evidence
        for every wave is too small.
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
