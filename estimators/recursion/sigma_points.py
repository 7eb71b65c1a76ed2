"""The loop of `methods.ukf`: sigma points through the exact sampled model, in compiled code."""

import numpy as np

from flexaxis.estimators.recursion.joint import project
from flexaxis.estimators.recursion.level import judge, show
from flexaxis.estimators.recursion.square_root import bound_root, triangularize
from flexaxis.estimators.sampling.compiler import compiled, inlined


@compiled
def ukf_loop(tunings, states, u, y, valid, estimates, trace):  # noqa: PLR0917
    """Take samples, as `flexaxis.estimators.recursion.loop.sample_loop`."""
    tuning, state = tunings[0], states[0]
    for k in range(len(u)):
        correct(tuning, state, y[k], valid[k])
        draw(tuning, state)
        evaluate(tuning, state)
        propagate(tuning, state, u[k])
        for i in range(estimates.shape[1]):
            estimates[k, i] = state["xi"][i]
        show(state, trace[k])


@inlined
def correct(tuning, state, y, valid):
    """Take ξ̂ and S from the propagated points, and through the measurement."""
    xi, S, A = state["xi"], state["S"], state["array"]
    m, p = tuning["m"], tuning["p"]
    points = 2 * m + 1
    spread = gather(tuning, state)
    y = judge(tuning, state, y, valid, xi[m], spread)
    use = not np.isnan(y)
    A[points + p, 0] = np.sqrt(state["noise"])
    if not use:
        for j in range(points):
            A[j, 0] = 0.0
    triangularize(A, points + p + 1, 1 + m)
    for i in range(m):
        for j in range(i, m):
            S[i, j] = A[1 + i, 1 + j]
        if use:
            xi[i] += A[0, 1 + i] * ((y - xi[m]) / A[0, 0])
    bound_root(S, tuning["ceiling"], 1.0)
    project(xi, tuning["lower"], tuning["upper"])


@inlined
def gather(tuning, state):
    """Write ξ̂⁻, ŷ and the array of deviations and √W, y first; return the variance of ŷ."""
    xi, A, Z = state["xi"], state["array"], state["points"]
    m, p = tuning["m"], tuning["p"]
    points = 2 * m + 1
    spread = 0.0
    for i in range(m + 1):
        mean = 0.0
        for j in range(points):
            mean += tuning["mean"][j] * Z[i, j]
        for j in range(points):
            A[j, (i + 1) % (m + 1)] = tuning["root"][j] * (Z[i, j] - mean)
        for j in range(p + 1):
            A[points + j, i] = 0.0
        xi[i] = mean
    for j in range(points):
        spread += A[j, 0] ** 2
    for i in range(p):
        for j in range(p):
            A[points + i, 1 + j] = tuning["walk"][i, j]
    return spread


@inlined
def draw(tuning, state):
    """Place the sigma points."""
    xi, S, Z = state["xi"], state["S"], state["points"]
    m = tuning["m"]
    for i in range(m):
        Z[i, 0] = xi[i]
        for j in range(m):
            step = tuning["reach"] * S[j, i] if j <= i else 0.0
            Z[i, 1 + j] = xi[i] + step
            Z[i, 1 + m + j] = xi[i] - step


@inlined
def evaluate(tuning, state):
    """Write the entries of [A B; C 0] that depend on θ, at every point."""
    M, Z, entry = state["M"], state["points"], tuning["entry"]
    for j in range(2 * tuning["m"] + 1):
        for t in range(len(entry)):
            M[entry[t], j] = 0.0
        for t in range(len(entry)):
            value = tuning["coefficient"][t]
            for i in range(tuning["p"]):
                e = tuning["exponent"][t, i]
                bounded = min(max(Z[i, j], tuning["lower"][i]), tuning["upper"][i])
                for _ in range(abs(e)):
                    value = value * bounded if e > 0 else value / bounded
            M[entry[t], j] += value


@inlined
def propagate(tuning, state, u):
    """Take every point over one sample, with u held, by the Taylor series of the exact step."""
    Z, V, W = state["points"], state["power"], state["next"]
    p, n, points = tuning["p"], tuning["m"] - tuning["p"], 2 * tuning["m"] + 1
    for i in range(n):
        for j in range(points):
            Z[p + i, j] *= tuning["keep"][i]
    for k in range(tuning["substeps"] * tuning["order"] + 1):
        done = k % tuning["order"]  # powers of A T/s; at last, the output is read
        if done == 0:
            for i in range(n + 1):
                for j in range(points):
                    V[i, j] = Z[p + i, j] if i < n else u
        multiply(tuning, state["M"], V, W, n, points)
        for j in range(points):
            Z[p + n, j] = W[n, j]
            V[n, j] = 0.0  # the held input does not change
        if k < tuning["substeps"] * tuning["order"]:
            for i in range(n):
                for j in range(points):
                    V[i, j] = W[i, j] / (done + 1)
                    Z[p + i, j] += V[i, j]


@inlined
def multiply(tuning, M, V, W, n, points):  # noqa: PLR0917
    """W ← [A B; C 0] V, point by point."""
    for i in range(n + 1):
        for j in range(points):
            W[i, j] = 0.0
    for e in range(len(M)):
        i, c = tuning["row"][e], tuning["column"][e]
        for j in range(points):
            W[i, j] += M[e, j] * V[c, j]
