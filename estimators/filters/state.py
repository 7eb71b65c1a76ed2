"""Components that all filters use: scalar variables, initial arrays, and bounds on P and θ."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.models.discretisation import plan
from flexaxis.estimators.models.matrix_rows import padded
from flexaxis.estimators.models.memory import numbers
from flexaxis.estimators.models.series import axis_arrays

MEMORY = 2.0  # s, memory of R: R has a relative standard deviation of 5 % (400 samples at 5 ms)
KNOWN = 50.0  # samples after which R is accurate enough (20 %) to detect outliers
ASTRAY_MEMORY = 2.0  # s, memory of the means by which a lost filter is detected
PATIENCE = 5.0  # time until a filter counts as lost, relative to ASTRAY_MEMORY: ten time constants
UNKNOWN = 1.0  # s, time after which an error of the state has decayed

_TUNING = (
    "forgetting",  # λ
    "memory",  # samples over which R is averaged
    "known",  # 1 if the noise variance is given
    "rests",  # 1 if R is learnt at rest as well
    "first_torque_noise",  # initial value of `torque_noise`, 0 for a filter without it
    "counts",  # 1 if y is an angle that is counted from the first reading
    "correct",  # 1 if the state is corrected when θ changes
    "clip",  # standard deviations to which a residual is limited
    "consistency",  # variance of a clipped residual, for a variance of one before clipping
    "largest",  # largest variance of an estimate relative to θ(0)²
    "rule",  # rule of forgetting, see `forgetting`
    "level", "first", "next", "reset", "short", "long", "least",  # options of the rules
    "stay",  # probability that a mode does not change from one sample to the next
    "astray_memory", "unknown", "heeds",  # see `fault_monitor`
)  # fmt: skip
_NOISE = (
    "prediction",
    "innovation",
    "innovation_variance",
    "noise",  # R, 0 while R is unknown
    "samples",  # number of samples in the mean R
    "run",  # number of consecutive samples that were used
    "latest",  # innovation of the last sample, whether or not the sample was used
    "wild",  # number of consecutive samples that are far from ŷ and from the previous sample
    "lone",  # 1 if the last innovation exceeded WILD and the innovation before it was below CLIP
    "spikes",  # 1 if a "lone" sample was ever followed by a normal one or by an opposite outlier
    "anchored",  # 1 from the first reading on
    "origin",  # reading at which the counted angle is zero
    "rounding",  # variance of the rounding of an encoder, 0 while unknown
    "driven",  # index of the state that the torque drives
    "learnt",  # number of samples from which the torque noise was learnt
    "torque_noise",  # variance that unmodelled torques add to the driven state per sample
)
_MONITOR = (
    "reading",  # last reading of the sensor
    "foreseen",  # ŷ when this reading first occurred
    "stuck",  # 1 while the sensor is stuck
    "doubted",  # 1 from the detection of a stuck sensor until the reading changes
    "judged",  # number of samples in the means ``squares``
    "last_left",  # ε of the last sample
    "gone",  # number of samples for which a filter with forgetting has been lost
    "patience",  # time until the filter counts as lost, as a multiple of the memory
    "anew",  # 1 if the filter should be reset, 2 if R is unusable as well
    "earlier",  # R before the last reset
    "waits",  # remaining samples that are ignored after a reset during motion
)
_PREDICTION_ERROR = (
    "surprise",  # clipped residual
    "scale",  # 1 + ψᵀPψ of the last measurement
    "quiet",  # R̂ before the last measurement
    "signal",  # mean square of ŷ
)
_JOINT = (
    "spread",  # hᵀPh
    "probability",  # probability of a mode
    "predicted",  # probability of a mode, predicted before the sample is used
    "logarithm",  # logarithm of the likelihood of a mode
)
NUMBERS = np.dtype(
    [(name, float) for name in (*_TUNING, *_NOISE, *_MONITOR, *_PREDICTION_ERROR, *_JOINT)]
    + [
        ("levels", float, 4),  # means of squares and of squared differences, then both over KNOWN
        ("past", float, 3),  # previous innovations, the last one first
        ("rails", float, 2),  # lowest and highest reading at which the sensor was stuck, or NaN
        ("squares", float, 3),  # means of ε², of y², and of ε[k] ε[k−1]
        ("sums", float, 4),  # variables of a rule of forgetting
    ]
)
"""NumPy record type of all scalar settings and variables of a filter."""
_UNSET = "prediction", "innovation", "innovation_variance", "reading", "rails", "earlier"


def first_arrays(design: Design, width: int, **more: ArrayLike) -> dict[str, NDArray]:
    """
    Return the initial values of the arrays that all filters use, keyed by array name.

    The axis is initially at rest. The filter estimates the noise variance R if the design does not
    specify the noise.

    Parameters
    ----------
    design : Design
    width : int
        Number of values that are stored for each state: the state itself and its derivatives.
    **more : array_like
        Initial values of further scalar variables.
    """
    model, lanes, period = design.model, padded(width), design.period
    now = {
        "known": design.noise > 0,
        "noise": design.noise**2,
        "memory": max(MEMORY / period, KNOWN),
        "astray_memory": ASTRAY_MEMORY / period,
        "unknown": round(UNKNOWN / period),
        "patience": PATIENCE,
    }
    steps = plan(model, design.lower, design.upper, period)
    return {
        "now": numbers(NUMBERS, dict.fromkeys(_UNSET, np.nan) | now | more),
        **axis_arrays(model, steps, period, lanes),
        "theta": design.theta0,
        "X": np.zeros((model.n + 1, lanes)),
        "drift": design.drift,
        "lower": design.lower,
        "upper": design.upper,
    }


@inlined
def is_known(now):
    """Return whether the noise variance R is specified or was estimated from enough samples."""
    return now["samples"] >= KNOWN or now["known"] > 0.0


@inlined
def bound(P, ceiling):
    """Scale rows and columns of P so that no variance P_ii exceeds its limit ``ceiling[i]``."""
    for i in range(len(ceiling)):
        if P[i, i] > ceiling[i]:
            factor = np.sqrt(ceiling[i] / P[i, i])
            for j in range(len(P)):
                P[i, j] *= factor
                P[j, i] *= factor


@inlined
def project(theta, lower, upper):
    """Clip the first elements of θ to the interval from ``lower`` to ``upper``."""
    for i in range(len(lower)):
        theta[i] = np.minimum(np.maximum(theta[i], lower[i]), upper[i])  # NaN remains NaN


@inlined
def subtract(P, v, w):
    """Subtract w v vᵀ from P, and copy the lower triangle to the upper one to keep P symmetric."""
    for i in range(len(P)):
        for j in range(i + 1):
            P[i, j] -= w * v[i] * v[j]
            P[j, i] = P[i, j]
