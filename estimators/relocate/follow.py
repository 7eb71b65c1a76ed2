"""
Take a model over a sample from the measured angle.

Where a torque depends on the angle, as cogging does, a model that integrates its own speed would
run away: on an axis that its controller holds at an angle at which cogging is unstable, the model
has no controller. So the angle of the model begins every sample where it was measured.
"""

import numpy as np

from flexaxis.estimators.models.laws import KINDS
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.sampling.compiler import compiled, inlined
from flexaxis.estimators.sampling.sampled import travel

SINUSOID = KINDS.index("sinusoid")


def angle_of(model: Parametrization) -> int:
    """Return which state is the angle on which a torque depends; −1 where there is none."""
    if model.laws is None:
        return -1
    for kind, drive in zip(model.laws.kind, model.laws.drive, strict=True):
        if kind == SINUSOID:
            return int(abs(drive[:-1]).argmax())
    return -1


@compiled
def follow(prepared, X, moved, u):
    """
    Take states and sensitivities over one sample, as `travel` does.

    Parameters
    ----------
    prepared : Prepared
    X, moved : (rows, n+1) arrays
    u : (2,) array
        Torque held from the start of the sample on, and the motor angle there as measured.
    """
    for i in range(len(prepared.kind)):
        if prepared.kind[i] == SINUSOID:
            for j in range(prepared.drive.shape[1] - 1):
                if prepared.drive[i, j] != 0.0:
                    X[0, j] = u[1]
                    for a in range(1, len(X)):
                        X[a, j] = 0.0
    travel(prepared, X, moved, u[0])


@inlined
def integrate(tuning, state, y, valid):
    """
    Keep the measured angle; its sensitivities are zero.

    Of speeds it is the sum by the trapezoidal rule, of increments the sum itself. In a gap the
    model's output stands for y.
    """
    row = tuning["angle"]
    if row < 0:
        return
    if not valid:
        y = state["expected"] if np.isfinite(state["expected"]) else state["last"]
    before = y if tuning["increments"] > 0 or state["count"] == 0 else state["last"]
    if state["count"] > 0:
        state["angle"] += tuning["period"] * 0.5 * (y + before)
    state["last"] = y
    X = state["X"]
    X[row, 0] = state["u"][1] = state["angle"]
    for a in range(1, X.shape[1]):
        X[row, a] = 0.0
