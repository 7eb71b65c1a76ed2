"""
The noise variance of y in a Kalman filter: as given, or learnt from the innovations as it runs.

With e = y − ŷ, claimed to have the variance S = hᵀPh + R, a step of expectation-maximisation takes
R to hᵀPh R/S + e² R²/S²: a sample in which the uncertainty of ξ hides the noise says little (R. H.
Shumway and D. S. Stoffer, *An approach to time series smoothing and forecasting using the EM
algorithm*, J. Time Series Analysis 3 (1982), in recursive form). R is a mean of these.

A parameter that has changed looks like noise to it. But what comes from that is smooth, and gone
from a third difference: a second mean takes (e[k] − 3e[k−1] + 3e[k−2] − e[k−3])²/20 for e² (T.
Gasser, L. Sroka and C. Jennen-Steinmetz, *Residual variance and residual pattern in nonlinear
regression*, Biometrika 73 (1986), for the second). R is the smaller of both. Where they differ by
far, it is learnt more slowly.

All is relative to what the filter has seen, so that units of y do not matter.
"""

from math import erf, exp, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.filters.fault_monitor import is_stuck, monitor_numbers
from flexaxis.estimators.models.compiler import inlined

MEMORY = 2.0  # s, of R; 400 samples at 5 ms give a relative standard deviation of 5 %
KNOWN = 50.0  # samples from which on R can judge a sample; its deviation is √(2/50) = 20 %
CLIP = 3.0  # standard deviations beyond which an innovation counts as one of that size for R
SURE = 2.0  # times the mean over the last KNOWN, above which R falls to it: 7 of its deviations
SMOOTH = 0.25  # squared differences over squares, of white noise 1 ± .2, below which it is a model
# that is wrong, from which R is learnt more slowly
SLOWER = 10.0  # times the memory
ODD = 100.0  # standard deviations beyond which a sample that differs as much from the one before is
# not used: no noise reaches that. A fault that does lasts, and counts as one of that size
WILD = 8.0  # the same, of a sensor that has given such a sample alone: normal noise gets there once
# in 1e15 samples. Of any other it would cost the first sample of a large fault
ROW = 2  # such samples in a row, at most, that are not used: a fault lasts
GROWS = 3.0  # times the first of them that the second may be, with its sign and not smaller, and is
# used: what a jump of torque does to a speed doubles in a sample
FINEST = 1e-6  # of y, below which its noise is that of the arithmetic
MOVING = 0.5  # ŷ over its noise from which on a sample counts for R: an encoder at rest is exact


def clipped_variance(clip: float) -> float:
    """Return E min(z², c²) of a standard normal z: what clipping leaves of the variance."""
    return erf(clip / sqrt(2)) * (1 - clip**2) + clip**2 - clip * sqrt(2 / pi) * exp(-(clip**2) / 2)


CONSISTENCY = clipped_variance(CLIP)


def level(design: Design, *, rests: bool = False) -> dict[str, ArrayLike]:
    """
    Return the numbers that `judge` needs; σ is learnt where the design has none.

    Parameters
    ----------
    design : Design
    rests : bool
        Whether an axis at rest tells of its noise as well, wherever the reading is not the one
        before, which only an encoder's is.
    """
    return monitor_numbers(design.period) | {
        "known": float(design.noise > 0),
        "memory": max(MEMORY / design.period, KNOWN),
        "rests": float(rests),
        "prediction": np.nan,
        "innovation": np.nan,
        "innovation_variance": np.nan,
        "noise": design.noise**2,
    }


@inlined
def judge(state, y, valid, prediction, spread):
    """
    Keep the innovation and learn R from it; return y as it is to be used, or NaN if it is not.

    ``spread`` is hᵀPh. Nothing is used before something moves if R has to be learnt: then ξ is not
    yet seen either, and R starts from the first sample as e² + hᵀPh, all that is not known of y.
    """
    noise = state["noise"]
    S = spread + noise
    state["prediction"], state["innovation"] = prediction, np.nan
    state["innovation_variance"] = S if noise > 0.0 else np.nan
    fresh = y != state["reading"]
    judged = state["samples"] >= KNOWN or state["known"] > 0.0
    if not valid:
        state["reading"] = np.nan
    elif is_stuck(state, y, prediction, S if judged else spread + state["earlier"]):
        valid = False
    if not valid:
        state["run"], state["innovation_variance"] = 0.0, np.nan
        state["latest"] = state["lone"] = state["wild"] = 0.0
        return np.nan
    e = y - prediction
    state["innovation"] = e
    if noise <= 0.0:
        nothing = not fresh or e**2 + spread == 0.0 if state["rests"] > 0.0 else prediction == 0.0
        if nothing:
            return np.nan
        _begin(state, e**2 + spread)
        return y
    sd = np.sqrt(S)
    if _is_wild(state, e, sd, judged):
        state["run"] = 0.0
        return np.nan
    e = min(max(e, -ODD * sd), ODD * sd)
    rough = _roughness(state["past"], e)
    state["run"] += 1.0
    moves = fresh if state["rests"] > 0.0 else prediction**2 > MOVING**2 * noise
    if state["known"] == 0.0 and moves:
        _learn(state, spread, e**2, rough if state["run"] > 3.0 else np.nan)
        state["noise"] = max(state["noise"], (FINEST * prediction) ** 2)
    return prediction + e


@inlined
def _is_wild(state, e, sd, judged):
    """Return whether a sample is a wild one, which says nothing of the axis."""
    before, state["latest"] = state["latest"], e
    back = min(abs(e), abs(e + before))  # a wild angle is in two increments, there and back
    if state["lone"] > 0.0 and back <= CLIP * sd:
        state["spikes"] = 1.0
    state["lone"] = 1.0 if judged and abs(e) > WILD * sd and abs(before) <= CLIP * sd else 0.0
    far = WILD * sd
    if state["spikes"] == 0.0 or not judged:
        far = ODD * sd
    if min(abs(e), abs(e - before)) <= far:
        state["wild"] = 0.0
        return False
    state["wild"] += 1.0
    grows = state["wild"] > 1.0 and 1.0 <= e / before <= GROWS
    return state["wild"] <= ROW and not grows


@inlined
def _begin(state, square):
    """Start R from a first sample."""
    state["noise"], state["samples"] = square, 1.0
    for i in range(4):
        state["levels"][i] = square


@inlined
def _roughness(past, e):
    """Return (e − 3e₁ + 3e₂ − e₃)²/20 with the three innovations before, and keep the last ones."""
    rough = (e - 3.0 * past[0] + 3.0 * past[1] - past[2]) ** 2 / 20.0
    past[2], past[1], past[0] = past[1], past[0], e
    return rough


@inlined
def _learn(state, spread, square, rough):
    """Take squares of the innovation and of its difference into R."""
    R, levels = state["noise"], state["levels"]
    S = spread + R
    share = R / S
    rest, scale = spread * share, share**2
    if (
        state["samples"] < KNOWN
    ):  # R is kept on the high side, so that no sample is believed too much
        scale = 1.0
    count = state["samples"] = min(state["samples"] + 1.0, state["memory"])
    levels[2] += (rest + scale * square - levels[2]) / min(count, KNOWN)
    if rough >= 0.0:  # not NaN, as after a gap
        levels[3] += (rest + scale * rough - levels[3]) / min(count, KNOWN)
    if count > KNOWN:
        square = min(square, CLIP**2 * S) / CONSISTENCY
        rough = min(rough, CLIP**2 * S) / CONSISTENCY
        if levels[3] < SMOOTH * levels[2]:
            count *= SLOWER
    levels[0] += (rest + scale * square - levels[0]) / count
    if rough >= 0.0:
        levels[1] += (rest + scale * rough - levels[1]) / count
    for i in range(2):
        levels[i] = min(levels[i], SURE * levels[2])
    state["noise"] = min(levels[0], levels[1])


@inlined
def show(state, row):
    """Write ŷ, innovation and its variance (3,) of a sample."""
    row[0], row[1] = state["prediction"], state["innovation"]
    row[2] = state["innovation_variance"]
