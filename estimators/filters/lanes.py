"""The model of a filter, and its state at the start."""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.models.discretisation import law_plan, plan
from flexaxis.estimators.models.rows import padded
from flexaxis.estimators.models.series import axis_arrays


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
        Before the first sample, without derivatives.
    """
    model, lanes = design.model, padded(width)
    box = design.lower, design.upper
    steps = (1, *plan(model, *box, design.period)) if model.laws is None else None
    steps = steps or law_plan(model, *box, design.period)
    X = np.zeros((model.n + 1, lanes))
    X[:-1, 0] = design.x0
    X[-1, 0] = model.blocks(design.theta0)[0, -1, :-1] @ design.x0
    return axis_arrays(model, steps, design.period, lanes), X
