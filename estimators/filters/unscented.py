"""
The loop of `methods.ukf`: sigma points through the exact sampled model, in compiled code.

The model is linear in the state. So of the points that lie apart in the state only, which have the
same θ, those on both sides of the mean go over a sample as that and one difference: 1+n+2p lanes do
for 1+2(p+n) points. In the array that is triangularised a pair z ± d makes the rows √(2v) d and
√(2v) (z − z̄), of which all of the second kind are one with that of the mean's.
"""

import numpy as np

from flexaxis.estimators.filters.covariance import project
from flexaxis.estimators.filters.noise import judge, show
from flexaxis.estimators.filters.square_root import bound_root, triangularize
from flexaxis.estimators.models.compiler import Compiled, inlined, remembered
from flexaxis.estimators.models.discretisation import Pattern
from flexaxis.estimators.models.kernel import convey, place


@remembered
def ukf_loop(pattern: Pattern) -> Compiled:
    """Return the compiled loop for models of this pattern."""
    entries, series = place(pattern), convey(pattern)

    def run(tunings, states, u, y, valid, estimates, trace):  # noqa: PLR0917
        tuning, state = tunings[0], states[0]
        for k in range(len(u)):
            _correct(tuning, state, y[k], valid[k])
            _draw(tuning, state)
            _drive(tuning, state, u[k])
            entries(tuning["coefficients"], state["theta"], state["M"])
            series(
                state["M"],
                state["X"],
                state["inputs"],
                tuning["weights"],
                tuning["order"],
                tuning["substeps"],
            )
            for i in range(estimates.shape[1]):
                estimates[k, i] = state["xi"][i]
            show(state, trace[k])

    size = f"{pattern.n} states and {pattern.p} parameters"
    return Compiled(run, label=f"a filter (an unscented Kalman filter) for {size}")


@inlined
def _correct(tuning, state, y, valid):
    """Take ξ̂ and S from the points as they have moved, and through the measurement."""
    xi, S, A, R = state["xi"], state["S"], state["array"], state["upper"]
    m, p = len(S), len(tuning["lower"])
    spread = _gather(tuning, state)
    y = judge(tuning, state, y, valid, xi[m], spread)
    use = not np.isnan(y)
    if not use:
        for j in range(state["X"].shape[1]):
            A[0, j] = 0.0
    A[0, 1 + m + 2 * p] = np.sqrt(state["noise"])
    triangularize(A.copy(), R)  # √W stays in it
    for i in range(m):
        for j in range(i, m):
            S[i, j] = R[1 + i, 1 + j]
        if use:
            xi[i] += R[0, 1 + i] * ((y - xi[m]) / R[0, 0])
    bound_root(S, tuning["ceiling"], 1.0)
    project(xi, tuning["lower"], tuning["upper"])


@inlined
def _gather(tuning, state):
    """
    Write ξ̂⁻, ŷ and the array of deviations, y first; return the variance of ŷ.

    What of the array are deviations of θ was written with the points, and √W before the first.
    """
    xi, A, X, scale = state["xi"], state["array"], state["X"], tuning["scale"]
    n, p = len(X) - 1, len(tuning["lower"])
    spread = 0.0
    for i in range(n + 1):
        apart, first, row = 0.0, X[i, 0], 0 if i == n else 1 + p + i
        for j in range(1 + n, 1 + n + 2 * p):
            apart += X[i, j] - first
        mean = first + tuning["weight"] * apart
        xi[p + i] = mean
        for j in range(X.shape[1]):
            A[row, j] = scale[j] * (X[i, j] - tuning["whole"][j] * mean)
    for j in range(X.shape[1]):
        spread += A[0, j] ** 2
    return spread


@inlined
def _draw(tuning, state):
    """Place the points: the mean, what lies apart from it in x, and both sides of it in θ."""
    xi, S, X = state["xi"], state["S"], state["X"]
    n, p, reach = len(X) - 1, len(tuning["lower"]), tuning["reach"]
    for i in range(n):
        for j in range(n):
            X[i, 1 + j] = reach * S[p + j, p + i] if j <= i else 0.0
        X[i, 0] = xi[p + i]
        for j in range(p):
            step = reach * S[j, p + i]
            X[i, 1 + n + j], X[i, 1 + n + p + j] = xi[p + i] + step, xi[p + i] - step
    for i in range(p):
        for j in range(1 + n):
            state["theta"][i, j] = xi[i]
        for j in range(p):
            _apart(tuning, state, i, j)


@inlined
def _apart(tuning, state, i, j):
    """Write θ_i of the points on both sides of the mean in direction j, and its deviations."""
    n, p = len(state["X"]) - 1, len(tuning["lower"])
    lower, upper, theta = tuning["lower"][i], tuning["upper"][i], state["theta"]
    step = tuning["reach"] * state["S"][j, i] if j <= i else 0.0
    for side in range(2):
        deviation, lane = step if side == 0 else -step, 1 + n + side * p + j
        theta[i, lane] = min(max(state["xi"][i] + deviation, lower), upper)
        state["array"][1 + i, lane] = tuning["scale"][lane] * deviation


@inlined
def _drive(tuning, state, u):
    """Write the torque of every point: differences have none."""
    for j in range(len(tuning["whole"])):
        state["inputs"][j] = tuning["whole"][j] * u
