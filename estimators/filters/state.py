"""Parts that all filters have in common: scalar variables, model and states, bounds on P and θ."""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.models.discretisation import plan
from flexaxis.estimators.models.rows import padded
from flexaxis.estimators.models.series import axis_arrays

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
    "torque_noise",  # variance [its unit²] that it gains per sample from unmodelled torques
)
_MONITOR = (
    "reading",  # last reading of the sensor
    "foreseen",  # ŷ when this reading first occurred
    "stuck",  # 1 while the sensor is stuck
    "doubted",  # 1 from the detection of a stuck sensor until the reading changes
    "judged",  # number of samples in the means
    "last_left",  # ε of the last sample
    "gone",  # number of samples for which a filter with forgetting has been lost
    "patience",  # time until the filter counts as lost, as a multiple of the memory
    "anew",  # 1 if the filter should be reset, 2 if R is useless as well
    "earlier",  # R before the last reset
    "waits",  # remaining samples that are ignored after a reset during motion
)
_PREDICTION_ERROR = (
    "expected",  # ŷ of the last sample
    "epsilon",
    "surprise",  # clipped residual
    "scale",  # 1 + ψᵀPψ of the last measurement
    "variance",  # variance of the innovation
    "quiet",  # R̂ before the last measurement
    "signal",  # mean square of ŷ
)
_JOINT = (
    "spread",  # hᵀPh
    "output",  # ŷ of a mode
    "probability",  # probability of a mode
    "predicted",  # probability of a mode, predicted before the sample is used
    "logarithm",  # logarithm of the likelihood of a mode
)
NUMBERS = np.dtype(
    [(name, float) for name in (*_TUNING, *_NOISE, *_MONITOR, *_PREDICTION_ERROR, *_JOINT)]
    + [
        ("levels", float, 4),  # means of squares, and of squared differences; both over KNOWN
        ("past", float, 3),  # previous innovations, the last one first
        ("rails", float, 2),  # lowest and highest reading at which the sensor was stuck, or NaN
        ("squares", float, 3),  # means of ε², of y², and of ε[k] ε[k−1]
        ("sums", float, 4),  # variables of a rule of forgetting
    ]
)
"""All scalars of a filter in one record of fixed type: tuning values and variables."""


def on_lanes(design: Design, width: int) -> tuple[dict[str, NDArray], NDArray[np.float64]]:
    """
    Return the arrays of a filter's model, and the states of the model with their derivatives.

    Parameters
    ----------
    design : Design
    width : int
        Number of values for each state: the state itself and its derivatives.

    Returns
    -------
    axis : dict of str to array
        Arrays from `flexaxis.estimators.models.series.axis_arrays`.
    X : (n+1, lanes) array
        States and output with derivatives; all zero, for an axis at rest.
    """
    model, lanes = design.model, padded(width)
    steps = plan(model, design.lower, design.upper, design.period)
    return axis_arrays(model, steps, design.period, lanes), np.zeros((model.n + 1, lanes))


@inlined
def bound(P, ceiling):
    """Scale rows and columns of P (m, m) so that no variance exceeds its ceiling (p,)."""
    for i in range(len(ceiling)):
        if P[i, i] > ceiling[i]:
            factor = np.sqrt(ceiling[i] / P[i, i])
            for j in range(len(P)):
                P[i, j] *= factor
                P[j, i] *= factor


@inlined
def project(theta, lower, upper):
    """Project the first elements of θ on the box."""
    for i in range(len(lower)):
        if theta[i] < lower[i]:  # min and max would hide a NaN
            theta[i] = lower[i]
        elif theta[i] > upper[i]:
            theta[i] = upper[i]
