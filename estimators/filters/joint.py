"""
An extended Kalman filter that jointly estimates the state and the parameters.

The filter models θ as constant during a sampling period, whereas the state x changes. Small
deviations δξ of the extended state ξ = [θ; x] satisfy δξ⁺ = F δξ with the transition matrix F = [I
0; G]. In the θ block of P, the time update therefore only adds the drift covariance W. The rows of
the array X contain the derivatives G = ∂x⁺/∂ξ and h = ∂y⁺/∂ξ with respect to ξ at the previous
sample. The time update of P is postponed until the measurement update, so that one matrix product
yields both G P and P h.
"""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.filters.state import NUMBERS, bound, first_arrays, project, subtract
from flexaxis.estimators.models.compiler import fused, inlined, summed
from flexaxis.estimators.models.matrix_rows import multiply, padded
from flexaxis.estimators.models.memory import Matrix, Memory, Vector
from flexaxis.estimators.models.series import Axis, over_sample

Array = NDArray[np.float64]


class Joint(NamedTuple):
    """
    The variables of a joint filter for p parameters and n states, where m = p + n.

    Attributes
    ----------
    now, axis : record array, Axis
        Scalar variables of the filter, and arrays of the axis model.
    theta : (p,) array
        Estimate of the relative parameters η.
    X : (> n, lanes) array
        States and output, and their derivatives with respect to ξ at the previous sample.
    drift : (p, p) array
        Covariance W that every time update adds to the covariance of θ.
    lower, upper : (p,) arrays
        Bounds of η.
    P : (m, w) array
        Covariance of ξ; the rows are padded with zeros.
    G, GP : (n+1, m), (n+1, w) arrays
        Derivatives of the predicted states and output with respect to ξ, and these derivatives
        multiplied by P.
    gain : (m,) array
        Gain K, multiplied by √S.
    ceiling : (p,) array
        Upper limits on the variances of η.
    """

    now: Annotated[NDArray[np.void], NUMBERS, 1]
    axis: Axis
    theta: Vector
    X: Matrix
    drift: Matrix
    lower: Vector
    upper: Vector
    P: Matrix
    G: Matrix
    GP: Matrix
    gain: Vector
    ceiling: Vector


def joint_arrays(design: Design, *, rests: bool = False, **more: float) -> dict[str, NDArray]:
    """
    Return the initial arrays of a joint filter in a dictionary keyed by array name.

    Parameters
    ----------
    design : Design
    rests : bool
        Whether the filter updates the noise variance R with every sensor reading that differs from
        the previous one, even while the axis is at rest.
    **more : float
        Initial values of further scalar variables.
    """
    p, n = len(design.theta0), design.model.states
    m, w, counts = p + n, padded(p + n), design.output == "angle"
    arrays = first_arrays(design, 1 + m, counts=counts, rests=rests or counts, **more)
    P, X = np.zeros((m, w)), arrays["X"]
    P[:p, :p], P[p:, p:m] = design.P0, design.x0_covariance
    X[:n, 1 + p : 1 + m] = np.eye(n)
    X[-1, 1 + p : 1 + m] = design.model.blocks(design.theta0)[0, -1, :n]
    return arrays | {
        "P": P,
        "G": np.zeros((n + 1, m)),
        "GP": np.zeros((n + 1, w)),
        "gain": np.zeros(m),
        "ceiling": np.ones(p),
    }


@inlined
def predict(state, u, laws):
    """Compute the one-sample prediction of ξ and its derivatives with respect to ξ."""
    X, p = state.X, len(state.lower)
    n = len(state.gain) - p
    X[:n, 1:] = 0.0
    for i in range(n):
        X[i, 1 + p + i] = 1.0
    over_sample(state.axis, state.theta, X, u, laws)


@fused
def look(state):
    """Copy the derivatives [G; hᵀ] from X to ``G``, and compute [G; hᵀ] P and hᵀPh."""
    X, G, GP = state.X, state.G, state.GP
    n, m = len(G) - 1, G.shape[1]
    for i in range(n + 1):
        k = i if i < n else len(X) - 1  # rows of X after the states may be torques of laws
        for a in range(m):
            G[i, a] = X[k, 1 + a]
    multiply(G, state.P, GP)
    state.now[0]["spread"] = _dot(GP[n], G[n])


@summed
def _dot(a, b):
    """Return the scalar product of ``a`` and ``b``; the compiler may reorder the summands."""
    total = 0.0
    for q in range(len(b)):
        total += a[q] * b[q]
    return total


@fused
def update(state, y, noise):
    """
    Perform the time update of P and then, if y is not NaN, the measurement update of ξ and P.

    S = hᵀPh + R, K = F P h/S, ξ ← ξ⁺ + K (y − y⁺), P ← F P Fᵀ + W − K S Kᵀ.
    """
    P, X, gain, theta, G, GP = state.P, state.X, state.gain, state.theta, state.G, state.GP
    p, n, now = len(state.lower), len(G) - 1, state.now[0]
    for a in range(p):
        for b in range(p):
            P[a, b] += state.drift[a, b]
    for i in range(n):
        for b in range(p):
            P[p + i, b] = P[b, p + i] = GP[i, b]
        for j in range(i + 1):
            P[p + i, p + j] = P[p + j, p + i] = _dot(GP[i], G[j])
    driven = p + int(now["driven"])
    P[driven, driven] += now["torque_noise"]
    if not np.isnan(y):
        root = 1.0 / np.sqrt(now["spread"] + noise)
        innovation = (y - X[-1, 0]) * root
        for i in range(p):
            gain[i] = root * GP[n, i]
            theta[i] += gain[i] * innovation
        for i in range(n):
            gain[p + i] = root * _dot(GP[i], G[n])
            X[i, 0] += gain[p + i] * innovation
        subtract(P, gain, 1.0)
    bound(P, state.ceiling)
    project(theta, state.lower, state.upper)


def read_joint(state: Memory) -> tuple[Array, Array]:
    """Return the parameter estimate η (p,) and its covariance (p, p)."""
    p = len(state["theta"])
    return state["theta"], state["P"][:p, :p]
