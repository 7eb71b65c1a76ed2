"""
The loop of `methods.ukf`: sigma points through the exact sampled model, in compiled code.

Points lie side by side: the mean, what lies apart from it one way, and the other.
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
            _draw(tuning, state, u[k])
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
    m = len(S)
    spread = _gather(tuning, state)
    y = judge(tuning, state, y, valid, xi[m], spread)
    use = not np.isnan(y)
    if not use:
        for j in range(1 + 2 * m):
            A[0, j] = 0.0
    A[0, 1 + 2 * m] = np.sqrt(state["noise"])
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
    xi, A, X, root = state["xi"], state["array"], state["X"], tuning["root"]
    n, p = len(X) - 1, len(tuning["lower"])
    spread = 0.0
    for i in range(n + 1):
        apart, row = 0.0, 0 if i == n else 1 + p + i
        for j in range(1, len(root)):
            apart += X[i, j] - X[i, 0]
        xi[p + i] = X[i, 0] + tuning["weight"] * apart
        for j in range(len(root)):
            A[row, j] = root[j] * (X[i, j] - xi[p + i])
    for j in range(len(root)):
        spread += A[0, j] ** 2
    return spread


@inlined
def _draw(tuning, state, u):
    """Place the points, with the torque of each; θ of those outside the box is at its border."""
    xi, S, p = state["xi"], state["S"], len(tuning["lower"])
    m = len(S)
    for j in range(1 + 2 * m):
        state["inputs"][j] = u
        for i in range(m):
            step = 0.0
            if j > 0:
                step = tuning["reach"] * S[(j - 1) % m, i]
            if j > m:
                step = -step
            if i < p:
                inside = min(max(xi[i] + step, tuning["lower"][i]), tuning["upper"][i])
                state["theta"][i, j] = inside
                state["array"][1 + i, j] = tuning["root"][j] * step
            else:
                state["X"][i - p, j] = xi[i] + step
