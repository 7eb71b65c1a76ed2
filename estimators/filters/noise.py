"""
The noise variance R of y, which the user specifies or the filter estimates.

The innovation e = y − ŷ has the variance S = hᵀPh + R. One step of the expectation-maximisation
algorithm replaces R by hᵀPh R/S + e² R²/S². To estimate R, the filter averages this expression over
time. The estimation of R is a recursive form of the method in *An approach to time series smoothing
and forecasting using the EM algorithm* (Shumway and Stoffer, 1982). A sample contains little
information about the noise variance R if the uncertainty of ξ dominates the innovation variance S.

A parameter change also increases the squared innovation e². The effect of a parameter change on e
is smooth, so it almost vanishes in the third difference of e. A second running mean therefore uses
the squared third difference (e[k] − 3e[k−1] + 3e[k−2] − e[k−3])²/20 instead of e². The idea of
using differences comes from *Residual variance and residual pattern in nonlinear regression*
(Gasser, Sroka and Jennen-Steinmetz, 1986). The estimate of R is the smaller of two running means:
the mean of e² and the mean of the squared third difference. If the mean of the squared third
difference is far below the mean of e², the filter adapts R more slowly.

All thresholds are relative to the data, so the unit of y does not matter. If y is an angle, the
filter measures the angle relative to the first reading. For an angle, R is at least q²/12, the
variance of the encoder's rounding error. The encoder step q is the smallest nonzero difference
between two successive readings so far.

Angle measurements are so accurate that every model error affects the innovations. If y is an angle,
the model therefore contains white torque noise that acts on the motor. The torque noise variance
starts large and is adapted until the normalised squared innovation e²/S has a mean of one.
"""

from math import erf, exp, pi, sqrt

import numpy as np

from flexaxis.estimators.filters.fault_monitor import is_stuck
from flexaxis.estimators.filters.state import KNOWN, is_known
from flexaxis.estimators.models.compiler import inlined

CLIP = 3.0  # standard deviations to which innovations are clipped before R is updated
SURE = 2.0  # R is at most this multiple of its mean over KNOWN samples (7 standard deviations)
SMOOTH = 0.25  # limit of the ratio of squared differences to squares, which is 1 ± 0.2 for white
# noise. A smaller ratio means that the model is wrong, and R is learnt more slowly
SLOWER = 10.0  # factor by which the memory of R is longer if the ratio is below SMOOTH
ODD = 100.0  # standard deviations: a sample that differs from both ŷ and the previous sample by
# more is skipped, because noise is never that large. A fault persists, and its residuals are used
WILD = 8.0  # the same limit after the first isolated outlier. Normal noise exceeds this limit once
# in 1e15 samples. Applied from the start, this limit would skip the first sample of a large fault
ROW = 2  # largest number of consecutive samples that are skipped; a fault lasts longer
GROWS = 3.0  # a second outlier of the same sign is used if it is at most three times the first: the
# effect of a torque jump on the speed doubles within a sample
FINEST = 1e-6  # smallest standard deviation of the noise relative to ŷ, due to rounding
LEARNS, REMEMBERS = 0.02, 2e-3  # change per sample of the logarithm of the torque-noise variance,
# divided by e²/S − 1. The first value is used for as many samples as the memory of R contains, and
# then the second. A parameter change also increases e², and with 0.02 the torque noise would absorb
# it. Chosen on seeds 0-5 of four encoders
LOWEST, HIGHEST = np.exp(-25.0), np.exp(2.0)  # limits of this variance relative to its initial
# value
MOVING = 0.5  # a sample updates R only if |ŷ| exceeds this multiple of the noise: an encoder at
# rest is exact


def clipped_variance(clip: float) -> float:
    """Return the variance of a standard normal variable after clipping to ± ``clip``."""
    return erf(clip / sqrt(2)) * (1 - clip**2) + clip**2 - clip * sqrt(2 / pi) * exp(-(clip**2) / 2)


CONSISTENCY = clipped_variance(CLIP)


@inlined
def judge(state, y, valid, prediction, spread):
    """
    Store the innovation and update R; return the checked output, or NaN to skip the sample.

    The argument ``spread`` is hᵀPh, the output variance due to the uncertainty of ξ. If R is
    unknown, the filter uses no sample until the axis moves. When the axis starts to move, R is
    initialised to e² + hᵀPh. If the model contains torque noise, R is initialised to the rounding
    error variance q²/12 instead. If y is an angle, the returned output is relative to the first
    reading.
    """
    noise = state["noise"]
    S = spread + noise
    first = state["counts"] > state["anchored"]
    if state["counts"] > 0.0 and valid:
        _count(state, y, prediction)
    origin = state["origin"]
    state["prediction"], state["innovation"] = origin + prediction, np.nan
    state["innovation_variance"] = S if noise > 0.0 else np.nan
    fresh = y != state["reading"]
    judged = is_known(state)
    if not valid:
        state["reading"] = np.nan
    elif is_stuck(state, y, origin + prediction, S if judged else spread + state["earlier"]):
        valid = False
    if not valid:
        state["run"], state["innovation_variance"] = 0.0, np.nan
        state["latest"] = state["lone"] = state["wild"] = 0.0
        return np.nan
    e = y - origin - prediction
    state["innovation"] = e
    if first:
        state["anchored"] = 1.0
        return prediction
    if noise <= 0.0:
        if not fresh or e**2 + spread == 0.0 if state["rests"] > 0.0 else prediction == 0.0:
            return np.nan  # R is still unknown
        square = state["rounding"]
        if state["first_torque_noise"] == 0.0:  # else P includes the error of the state
            square = max(square, e**2 + spread)
        state["noise"], state["samples"] = square, 1.0
        state["levels"][:] = square
        return y - origin
    sd = np.sqrt(S)
    if _is_wild(state, e, sd, judged):
        state["run"] = 0.0
        return np.nan
    rough = _roughness(state["past"], e)
    state["run"] += 1.0
    moves = fresh if state["rests"] > 0.0 else prediction**2 > MOVING**2 * noise
    if state["known"] == 0.0 and moves:
        _learn(state, spread, e**2, rough if state["run"] > 3.0 else np.nan)
        finest = state["rounding"] if state["counts"] > 0.0 else (FINEST * prediction) ** 2
        state["noise"] = max(state["noise"], finest)
    return prediction + e


@inlined
def _count(state, y, prediction):
    """Set the angle origin to the first reading, and estimate the rounding error variance."""
    if state["anchored"] == 0.0:
        state["origin"] = y - prediction
    rounding = (y - state["reading"]) ** 2 / 12.0
    if rounding > 0.0 and (state["rounding"] == 0.0 or rounding < state["rounding"]):
        state["rounding"] = rounding


@inlined
def _is_wild(state, e, sd, judged):
    """Return whether the current sample is an outlier."""
    before, state["latest"] = state["latest"], e
    back = min(abs(e), abs(e + before))  # an outlier of the angle affects two increments
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
def _roughness(past, e):
    """Return the squared third difference of the innovations, divided by 20, and store ``e``."""
    rough = (e - 3.0 * past[0] + 3.0 * past[1] - past[2]) ** 2 / 20.0
    past[2], past[1], past[0] = past[1], past[0], e
    return rough


@inlined
def _learn(state, spread, square, rough):
    """Update R with the squared innovation and the squared third difference of the innovations."""
    R, levels = state["noise"], state["levels"]
    S = spread + R
    share = R / S
    rest, scale = spread * share, share**2
    if state["samples"] < KNOWN and state["first_torque_noise"] == 0.0:
        scale = 1.0  # keep R large, so that no sample has too much weight
    count = state["samples"] = min(state["samples"] + 1.0, state["memory"])
    settled, squares = count > KNOWN, (square, rough)
    for i in range(2):
        if squares[i] >= 0.0:  # the second is NaN after a gap
            levels[2 + i] += (rest + scale * squares[i] - levels[2 + i]) / min(count, KNOWN)
    if settled and levels[3] < SMOOTH * levels[2]:
        count *= SLOWER
    for i in range(2):
        value = squares[i]
        if settled:
            value = min(value, CLIP**2 * S) / CONSISTENCY
        if value >= 0.0:
            levels[i] += (rest + scale * value - levels[i]) / count
        levels[i] = min(levels[i], SURE * levels[2])
    state["noise"] = min(levels[0], levels[1])


@inlined
def learn_torque_noise(state, rate, lowest):
    """Update the torque noise variance after a measurement, at the adaptation rate ``rate``."""
    square = state["innovation"] ** 2 / state["innovation_variance"]
    if state["first_torque_noise"] > 0.0 and square >= 0.0:  # NaN in a gap
        least, most = lowest * state["first_torque_noise"], HIGHEST * state["first_torque_noise"]
        state["learnt"] += 1.0
        growth = np.exp(rate * (min(square, CLIP**2) - 1.0))
        state["torque_noise"] = min(max(growth * state["torque_noise"], least), most)


@inlined
def allow_for_torques(state):
    """Adapt the torque noise variance quickly at first, and more slowly later."""
    rate = LEARNS if state["learnt"] < state["memory"] else REMEMBERS
    learn_torque_noise(state, rate, LOWEST)


@inlined
def show(state, row):
    """Write the prediction ŷ, the innovation and the innovation variance to ``row`` (3,)."""
    row[0], row[1] = state["prediction"], state["innovation"]
    row[2] = state["innovation_variance"]
