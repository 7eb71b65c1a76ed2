"""
What the first seconds show of a parameter, and what is said of one that stays as it was told.

What the excitation cannot see would only take up what is wrong with the model: under moves from
point to point a free inertia leaves the scale of all torques open.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

SEEN = 0.25  # standard deviation after the first seconds over that before, below which it is learnt

AS_TOLD = "the first seconds hardly move what it acts on, so it stays as it was told"
AS_ABSENT = "the first seconds hardly move what it acts on, so it is taken as absent"


def seen(after: ArrayLike, before: ArrayLike) -> NDArray[np.bool_]:
    """
    Return which parameters are much better known than before.

    Parameters
    ----------
    after, before : (p,) array_like
        Variances, in the same unit.
    """
    return np.asarray(np.sqrt(np.divide(after, before)) < SEEN)
