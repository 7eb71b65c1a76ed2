"""
Which friction of no known shape an axis has: a dictionary that is held against the first seconds.

A torque c B(x) of the motor that the model lacks moves the mean of what its filter gets wrong along
c δ, as a jump does (`flexaxis.estimators.glr.bank`), only that δ begins at zero and every sample
adds what the torque B does in it:

    δ ← F δ − K φ + Γ B.

So J and d of a column tell size and evidence of its coefficient, given that all else is learnt
beside it, and the columns that the bank does not need before the first seconds are over hold a
whole dictionary of B: dry friction that is larger one way, or grows with the load, and waves over
the angle, of every whole number in a turn, by themselves and times the sign of the speed. The best
of these is taken up, if any, into a filter that has one shape more among what it learns.
"""

import numpy as np

from flexaxis.estimators.models.compiler import inlined


@inlined
def look_for_shapes(tuning, state, bank):
    """Write what each torque of the dictionary was in the last sample, and what it does."""
    pull, push = bank["pull"], bank["push"]
    speed, read = state["mean"][0, 0], state["prediction"]
    if not np.isnan(state["innovation"]):  # where the model is wrong, its angle soon is
        read += state["innovation"]
    now, before = tuning["mean_speed"]
    bank["angle"] += tuning["period"] * (now * read + before * bank["read"])
    bank["read"] = read
    angle = bank["angle"] + 0.5 * tuning["period"] * speed
    for i in range(len(push)):
        push[i] = state["response"][0, i, 0] * tuning["law_steps"]
    t = np.tanh(speed / tuning["softness"])
    pull[0], pull[1] = t * t, abs(state["X"][tuning["load"], 0]) / tuning["load_size"] * t
    sine, cosine, s, c = 0.0, 1.0, np.sin(angle), np.cos(angle)
    for k in range(tuning["waves"]):
        sine, cosine = sine * c + cosine * s, cosine * c - sine * s
        pull[4 * k + 2], pull[4 * k + 3] = sine, cosine
        pull[4 * k + 4], pull[4 * k + 5] = t * sine, t * cosine


@inlined
def pull_columns(bank, root):
    """Add what the torques of the dictionary do to the columns, and to the output."""
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
    """Forget what the dictionary has seen: the axis begins to move."""
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
