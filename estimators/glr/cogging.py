"""
Cogging that nobody told: a torque over the angle of the motor, looked for in the first seconds.

A torque c B(φ) of the motor that the model lacks moves the error of its filter along c δ, as a jump
does (`flexaxis.estimators.glr.bank`), but δ begins at zero and every sample adds what the torque B
does in it: δ ← F δ − K φ + Γ B. So J and d of a column tell size and evidence of its coefficient.
The columns hold sine and cosine of every whole number of waves in a turn. The strongest wave, if it
is clear, becomes a law of cogging in a filter that begins where this one is.
"""

import numpy as np

from flexaxis.estimators.filters.loop import Record
from flexaxis.estimators.models.compiler import inlined

ALARM = 20.0  # nats by which a wave explains more than it costs: three times those of a jump, as
# it stays for good, and as friction that is still being learnt makes columns wrong
UNKNOWN = 3  # numbers that a wave has: two coefficients, and how many there are in a turn
FASTEST = 2.0  # radians that a wave may turn in a period at the rms speed; torques of faster ones
# are gone from their mean over the period


@inlined
def look_for_waves(tuning, state, bank):
    """Write what each torque was in the last sample, and what a torque does."""
    pull, push = bank["pull"], bank["push"]
    speed, read = state["mean"][0, 0], state["prediction"]
    if not np.isnan(state["innovation"]):  # where the model is wrong, its angle soon is
        read += state["innovation"]
    now, before = tuning["mean_speed"]
    bank["angle"] += tuning["period"] * (now * read + before * bank["read"])
    bank["read"] = read
    angle = bank["angle"] + 0.5 * tuning["period"] * speed
    for i in range(len(push)):  # friction of the motor, the first law, brakes where cogging drives
        push[i] = -state["response"][0, i, 0] * tuning["law_steps"]
    sine, cosine, s, c = 0.0, 1.0, np.sin(angle), np.cos(angle)
    for k in range(tuning["waves"]):
        sine, cosine = sine * c + cosine * s, cosine * c - sine * s
        pull[2 * k], pull[2 * k + 1] = sine, cosine


@inlined
def pull_columns(bank, root):
    """Add what the torques do to the columns, and to the output."""
    push, pull, phi, moved = bank["push"], bank["pull"], bank["phi"], bank["moved"]
    seen = push[-1] * root
    for c in range(len(phi)):
        phi[c] += seen * pull[c]
    for i in range(len(moved)):
        for c in range(len(phi)):
            moved[i, c] += push[i] * pull[c]


@inlined
def pair_columns(bank, z):
    """Keep what sine and cosine of a wave have in common, and how e repeats."""
    phi, cross = bank["phi"], bank["cross"]
    for c in range(len(phi) - 1):
        cross[c] += phi[c] * phi[c + 1]
    bank["repeated"] += z * bank["z_before"]
    bank["z_before"] = z


@inlined
def begin_columns(bank):
    """Forget all torques: the axis begins to move."""
    bank["D"][:] = 0.0
    bank["angle"], bank["read"] = 0.0, 0.0
    begin_sums(bank)


@inlined
def begin_sums(bank):
    """Forget all evidence: the filter is no longer thrown about, as by its first samples."""
    bank["J"][:] = 0.0
    bank["d"][:] = 0.0
    bank["cross"][:] = 0.0
    bank["repeated"], bank["z_before"] = 0.0, 0.0
    bank["chi2"], bank["used"] = 0.0, 0.0


def strongest_wave(bank: Record, waves: int, variance: float) -> tuple[int, float, float] | None:
    """
    Return how many waves in a turn explain the first seconds best, with their sine and cosine.

    A wave leaves χ² − Δ of the χ² of n samples, whose scale nobody knows: its evidence is
    ½ n ln(χ²/(χ² − Δ)), less ½ ln n for each unknown number, and the logarithm of how many waves
    there are. Innovations that it leaves may repeat each other: with the correlation ρ of
    successive ones as many as (1+ρ)/(1−ρ) count as one. What it explains is taken to repeat itself.

    Parameters
    ----------
    bank : record
    waves : int
        Number of waves in a turn of the fastest one.
    variance : float
        Of coefficients [(N m)²].

    Returns
    -------
    (waves, sine, cosine) or None
        Coefficients in N m; None where no wave is clear.
    """
    chi2, used = float(bank["chi2"]), float(bank["used"])
    if not waves or used < UNKNOWN or not chi2 > 0:
        return None
    J, d = (bank[name][: 2 * waves].reshape(waves, 2) for name in ("J", "d"))
    A = np.eye(2) * (J + max(1.0, chi2 / used) / variance)[:, None]
    A[:, 0, 1] = A[:, 1, 0] = bank["cross"][: 2 * waves : 2]
    size = np.linalg.solve(A, d[..., None])[..., 0]
    explained = np.minimum((size * d).sum(axis=1), (1 - 1 / used) * chi2)
    left = chi2 - explained
    rho = np.clip((bank["repeated"] - explained) / left, 0.0, 0.95)
    n = used * (1 - rho) / (1 + rho)
    gain = 0.5 * n * np.log(chi2 / left) - 0.5 * UNKNOWN * np.log(n) - np.log(waves)
    best = int(np.argmax(gain))
    return (best + 1, *size[best].tolist()) if gain[best] > ALARM else None
