"""
Cogging that nobody told: a torque over the angle of the motor, looked for in the first seconds.

A torque c B(φ) of the motor that the model lacks moves the error of its filter along c δ, as a jump
does (`flexaxis.estimators.glr.bank`), but δ begins at zero and every sample adds what the torque B
does in it: δ ← F δ − K φ + Γ B. So J and d of a column tell size and evidence of its coefficient.
The columns hold sine and cosine of every whole number of waves in a turn, which over many turns
have nothing in common. The strongest wave, if it is clear, becomes a law of cogging in a filter
that begins where this one is.
"""

from typing import NamedTuple

import numpy as np

from flexaxis.estimators.glr.bank import Columns
from flexaxis.estimators.models.compiler import fused, inlined
from flexaxis.estimators.models.memory import Memory, Vector
from flexaxis.estimators.models.rows import multiply

ALARM = 20.0  # nats by which a wave explains more than it costs: three times those of a jump, as
# it stays for good, and as friction that is still being learnt makes columns wrong
UNKNOWN = 3  # numbers that a wave has: two coefficients, and how many there are in a turn
FASTEST = 2.0  # radians that a wave may turn in a period at the rms speed; torques of faster ones
# are gone from their mean over the period


class Waves(NamedTuple):
    """
    Sine and cosine of K waves.

    Attributes
    ----------
    columns : Columns
    pull : (2K,) array
        Torque of each.
    """

    columns: Columns
    pull: Vector


@inlined
def look_for_waves(b, pull, now, axis):
    """Write what each torque was in the last sample, and what a torque does."""
    speed, read = axis.lanes[1, 0, 0], now["prediction"]  # w̄ of friction, the first law
    if not np.isnan(now["innovation"]):  # where the model is wrong, its angle soon is
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
    """Take the columns over the last sample, with what the torques did in it."""
    moved, pull, response = waves.columns.moved, waves.pull, axis.response
    multiply(G, waves.columns.D, moved)
    for i in range(len(moved)):  # friction brakes where cogging drives
        k = i if i < len(moved) - 1 else response.shape[1] - 1
        push = -response[0, k, 0] * axis.sizes[0]["steps"]
        for c in range(len(pull)):
            moved[i, c] += push * pull[c]


@inlined
def begin_waves(b, waves):
    """Forget all torques: the axis begins to move."""
    waves.columns.D[:] = 0.0
    b["angle"] = b["read"] = 0.0
    begin_sums(b, waves)


@inlined
def begin_sums(b, waves):
    """Forget all evidence: the filter is no longer thrown about, as by its first samples."""
    waves.columns.J[:] = 0.0
    waves.columns.d[:] = 0.0
    b["repeated"] = b["z_before"] = b["chi2"] = b["used"] = 0.0


def strongest_wave(bank: Memory, variance: float) -> tuple[int, float, float] | None:
    """
    Return how many waves in a turn explain the first seconds best, with their sine and cosine.

    A wave leaves χ² − Δ of the χ² of n samples, whose scale nobody knows: its evidence is
    ½ n ln(χ²/(χ² − Δ)), less ½ ln n for each unknown number, and the logarithm of how many waves
    there are. Innovations that it leaves may repeat each other: with the correlation ρ of
    successive ones as many as (1+ρ)/(1−ρ) count as one. What it explains is taken to repeat itself.

    Parameters
    ----------
    bank : Memory
    variance : float
        Of coefficients [(N m)²].

    Returns
    -------
    (waves, sine, cosine) or None
        Coefficients in N m; None where no wave is clear.
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
