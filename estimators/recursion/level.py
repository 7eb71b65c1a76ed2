"""
The noise variance of y in a Kalman filter: as given, or learnt from the innovations as it runs.

With e = y − ŷ, claimed to have the variance S = hᵀPh + R, one step of expectation-maximisation takes
R to hᵀPh R/S + e² R²/S²: a sample in which what is not known of ξ hides the noise says little (R. H.
Shumway and D. S. Stoffer, *An approach to time series smoothing and forecasting using the EM
algorithm*, J. Time Series Analysis 3 (1982), in the recursive form). A parameter that has changed
looks like noise to it, but slowly varying, so a second mean takes (e[k] − e[k−1])²/2 for e², from
which that is gone (J. Rice, *Bandwidth choice for nonparametric regression*, Annals of Statistics 12
(1984)). R is the smaller of the two.
"""

from math import erf, exp, pi, sqrt

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.sampling.compiler import jit

MEMORY = 2.0  # s, of R; 400 samples at 5 ms give a relative standard deviation of 5 %
KNOWN = 50.0  # samples from which on R can judge a sample; its deviation is √(2/50) = 20 %
CLIP = 3.0  # standard deviations beyond which an innovation counts as one of that size for R
CONSISTENCY = erf(CLIP / sqrt(2)) * (1 - CLIP**2) + CLIP**2 - CLIP * sqrt(2 / pi) * exp(
    -(CLIP**2) / 2
)  # E min(z², CLIP²) of a normal z: what clipping leaves of the variance
ODD = 100.0  # standard deviations beyond which a sample that stands alone is not used: no noise
# reaches that, and a fault that does lasts, and counts from its second sample on
MOVING = 0.1  # ŷ over its noise from which on a sample counts for R: an encoder at rest is exact

TUNING = [("known", float), ("memory", float)]
STATE = [
    ("prediction", float),
    ("innovation", float),
    ("innovation_variance", float),
    ("noise", float),  # R
    ("levels", float, (2,)),  # its two means
    ("samples", float),  # that they are the means of
    ("before", float, (2,)),  # innovation and variance of the last sample, if it was used
    ("odd", float),  # 1 where the last sample was beyond ODD
]


def set_level(tuning, start, noise: float | None, period: float) -> None:
    """
    Set what `judge` needs in records that have the fields `TUNING` and `STATE`.

    Parameters
    ----------
    tuning, start : records
    noise : float or None
        σ of y, in its unit; None where it is to be learnt.
    period : float
        Sampling period [s].

    Raises
    ------
    EstimatorError
        If that is no standard deviation.
    """
    if noise is not None and not (np.isfinite(noise) and noise > 0):
        raise EstimatorError(
            f"noise is {noise}; give the standard deviation of y, above 0, or None to estimate it"
        )
    tuning["known"], tuning["memory"] = noise is not None, max(MEMORY / period, KNOWN)
    start["noise"] = 0.0 if noise is None else noise**2
    start["prediction"] = start["innovation"] = start["innovation_variance"] = np.nan
    start["before"] = np.nan


@jit
def judge(tuning, state, y, valid, prediction, spread):  # noqa: PLR0917
    """
    Keep the innovation and learn R from it; return whether the sample is to be used.

    ``spread`` is hᵀPh. Nothing is used before something moves if R has to be learnt: then ξ is not
    yet seen either, and R starts from the first sample as e² + hᵀPh, all that is not known of y.
    """
    before, noise = state["before"], state["noise"]
    state["prediction"], state["innovation"] = prediction, np.nan
    state["innovation_variance"] = spread + noise
    first, last = before[0], before[1]
    before[0] = before[1] = np.nan
    if not valid:
        return False
    e = y - prediction
    state["innovation"] = e
    if tuning["known"] == 0.0 and state["samples"] == 0.0:
        state["innovation_variance"] = np.nan
        if prediction == 0.0:
            return False
        state["noise"] = e**2 + spread
        state["levels"][0] = state["levels"][1] = state["noise"]
        state["samples"] = 1.0
        return True
    S = spread + noise
    alone = state["odd"] == 0.0
    state["odd"] = 1.0 if e**2 > ODD**2 * S else 0.0
    if state["odd"] > 0.0 and alone:
        return False
    before[0], before[1] = e, S
    if tuning["known"] == 0.0 and prediction**2 > MOVING**2 * noise:
        rough = 0.5 * (e - first) ** 2 / (0.5 * (S + last))
        learn(tuning, state, spread, e**2 / S, rough)
    return True


@jit
def learn(tuning, state, spread, square, rough):  # noqa: PLR0917
    """Take squares of the innovation and of its difference, relative to S, into R."""
    R = state["noise"]
    S = spread + R
    share = R / S
    scale = R * share
    if state["samples"] < KNOWN:  # with R on the high side no sample is believed too much
        scale = S
    else:
        square = min(square, CLIP**2) / CONSISTENCY
        rough = min(rough, CLIP**2) / CONSISTENCY
    state["samples"] = min(state["samples"] + 1.0, tuning["memory"])
    levels = state["levels"]
    levels[0] += (spread * share + scale * square - levels[0]) / state["samples"]
    if rough >= 0.0:  # not NaN, as after a gap
        levels[1] += (spread * share + scale * rough - levels[1]) / state["samples"]
    state["noise"] = min(levels[0], levels[1])


@jit
def bound(P, ceiling):
    """Scale the rows and columns of P (m, m) whose variance is above its ceiling (p,) down to it."""
    for i in range(len(ceiling)):
        if P[i, i] > ceiling[i]:
            factor = np.sqrt(ceiling[i] / P[i, i])
            for j in range(len(P)):
                P[i, j] *= factor
                P[j, i] *= factor
