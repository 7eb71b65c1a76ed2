"""What all filters have: their numbers, a model with its states, bounds on P and θ."""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.models.discretisation import plan
from flexaxis.estimators.models.rows import padded
from flexaxis.estimators.models.series import axis_arrays

_TUNING = (
    "forgetting",  # λ
    "memory",  # samples, of the means that R is
    "known",  # 1 if the noise is given
    "rests",  # 1 if R is learnt at rest as well
    "counts",  # 1 if y is an angle, counted from its first reading
    "correct",  # 1 if the state moves with θ
    "clip",  # standard deviations to which a residual is limited
    "consistency",  # variance after clipping, for a variance of one
    "largest",  # variance of an estimate relative to θ(0)²
    "rule",  # of forgetting, see `forgetting`
    "level", "first", "next", "reset", "short", "long", "least",  # of rules of forgetting
    "stay",  # probability with which a mode stays
    "astray_memory", "unknown", "heeds",  # see `fault_monitor`
)  # fmt: skip
_NOISE = (
    "prediction",
    "innovation",
    "innovation_variance",
    "noise",  # R, 0 while nothing is known of it
    "samples",  # number of samples in the mean R
    "run",  # consecutive samples that were used
    "latest",  # the last innovation, of a used or unused sample
    "wild",  # consecutive samples that are far from ŷ and from the sample before
    "lone",  # whether the last sample was far, by WILD, and the one before it was not, by CLIP
    "spikes",  # whether a usual sample, or its opposite, has ever followed such a sample
    "anchored",  # 1 from the first reading on
    "origin",  # reading at which the counted angle is zero
    "rounding",  # variance of the rounding of an encoder, 0 while it is unknown
)
_MONITOR = (
    "reading",  # the last one
    "foreseen",  # ŷ when this reading first came
    "stuck",
    "doubted",  # 1 from the detection of a stuck sensor until it reads on
    "judged",  # samples in the means
    "last_left",  # ε of the last sample
    "gone",  # samples for which a filter that forgets has been lost
    "patience",  # memories until it counts as lost
    "anew",  # 1 if the filter should be reset, 2 if its R is useless as well
    "earlier",  # R before the last reset
    "waits",  # samples that it still waits after a reset in mid-motion
)
_PREDICTION_ERROR = (
    "expected",  # ŷ of the last sample
    "epsilon",
    "surprise",  # the residual, clipped
    "scale",  # 1 + ψᵀPψ of the last measurement
    "variance",  # of the innovation
    "quiet",  # R̂ before the last measurement
    "signal",  # mean square of ŷ
)
_JOINT = (
    "spread",  # hᵀPh
    "output",  # ŷ of a mode
    "probability",  # of a mode
    "predicted",  # probability of a mode before its sample is seen
    "logarithm",  # of the likelihood of a mode
)
NUMBERS = np.dtype(
    [(name, float) for name in (*_TUNING, *_NOISE, *_MONITOR, *_PREDICTION_ERROR, *_JOINT)]
    + [
        ("levels", float, 4),  # means of squares and of squared differences, and over KNOWN samples
        ("past", float, 3),  # innovations before, the last one first
        ("rails", float, 2),  # lowest and highest reading, where the sensor was stuck there
        ("squares", float, 3),  # means of ε², of y², and of ε[k] ε[k−1]
        ("sums", float, 4),  # of a rule of forgetting
    ]
)
"""The numbers of a filter, in one record of a fixed type: tuning, and what changes with samples."""


def on_lanes(design: Design, width: int) -> tuple[dict[str, NDArray], NDArray[np.float64]]:
    """
    Return the arrays of the model of a filter, and its states with derivatives.

    Parameters
    ----------
    design : Design
    width : int
        A value and its derivatives.

    Returns
    -------
    axis : dict of str to array
        As of `flexaxis.estimators.models.series.axis_arrays`.
    X : (n+1, lanes) array
        Zero: at rest, without derivatives.
    """
    model, lanes = design.model, padded(width)
    steps = plan(model, design.lower, design.upper, design.period)
    return axis_arrays(model, steps, design.period, lanes), np.zeros((model.n + 1, lanes))


@inlined
def bound(P, ceiling):
    """Scale rows and columns of P (m, m) whose variance is above its ceiling (p,) down to it."""
    for i in range(len(ceiling)):
        if P[i, i] > ceiling[i]:
            factor = np.sqrt(ceiling[i] / P[i, i])
            for j in range(len(P)):
                P[i, j] *= factor
                P[j, i] *= factor


@inlined
def project(theta, lower, upper):
    """Put the first of θ back into the box."""
    for i in range(len(lower)):
        if theta[i] < lower[i]:  # not min and max, which would hide a NaN
            theta[i] = lower[i]
        elif theta[i] > upper[i]:
            theta[i] = upper[i]
