"""What is known before the first sample, and what a fit of all data makes of it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.recursion.design import Design

Array = NDArray[np.float64]


class Prior(NamedTuple):
    """θ (p,) before the first sample, standard deviations of the (known,) first, noise variance."""

    theta: Array
    deviation: Array
    noise: float


class Fitted(NamedTuple):
    """
    Parameters that explain the data.

    Attributes
    ----------
    theta : (p,) array
    active : (q,) int array
        Those that are learnt; the others are as they were told.
    noise : float
        Its variance.
    because : dict of str to str
        Why the others are not learnt.
    """

    theta: Array
    active: NDArray[np.int64]
    noise: float
    because: dict[str, str]


def output_gain(design: Design) -> float:
    """Return y over the motor speed, one unless y has another unit."""
    A, _, C = design.model.matrices(design.theta0)
    gain = float(np.abs(C).sum())
    if design.output == "increment":  # its state integrates the speed over a sample
        gain *= design.period * float(np.abs(A[design.model.reset[-1]]).sum())
    return gain
