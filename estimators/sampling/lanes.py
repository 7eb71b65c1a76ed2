"""
Values and their derivatives side by side, and how they go through a model and over a sample.

A row of lanes [a, ∂a/∂θ_1, …, ∂a/∂θ_p] follows the product rule, a·v for the value and a·∂v + ∂a·v
for each derivative. `fill` and `step` do the whole of eq. (17)–(23) in such rows, for any model and
any of its parameters; `flexaxis.estimators.sampling.kernel` writes the same out for a pattern.
"""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.sampling.compiler import compiled

Array = NDArray[np.float64]


@compiled
def fill(entry, exponents, coefficients, theta, active, M):  # noqa: PLR0917
    """
    Write entries Σ c·Πθ^e of [A B; C 0], with derivatives, into their rows; right at θ = 0 as well.

    Parameters
    ----------
    entry : (t,) int array
        Row of M that each term belongs to.
    exponents : (t, p) int array
    coefficients : (t,) array
    theta : (p,) array
    active : (q,) int array
        Parameters to differentiate by.
    M : (entries, ≥ 1+q) array
        Rows that a term belongs to are overwritten.
    """
    for t in range(len(entry)):
        for a in range(M.shape[1]):
            M[entry[t], a] = 0.0
    for t in range(len(entry)):
        for a in range(-1, len(active)):
            lowered = active[a] if a >= 0 else -1
            value = coefficients[t]
            for i in range(len(theta)):
                e = exponents[t, i]
                if i == lowered:  # d θ^e/dθ = e θ^(e−1)
                    value *= e
                    e -= 1
                if value != 0.0:
                    for _ in range(abs(e)):
                        value = value * theta[i] if e > 0 else value / theta[i]
            M[entry[t], 1 + a] += value


@compiled
def _product(row, column, M, V, W):
    """W ← [A B; C 0] V by the product rule, rows of lanes (n+1, lanes)."""
    for i in range(len(W)):
        for a in range(W.shape[1]):
            W[i, a] = 0.0
    for e in range(len(row)):
        i, j = row[e], column[e]
        W[i, 0] += M[e, 0] * V[j, 0]
        for a in range(1, W.shape[1]):
            W[i, a] += M[e, 0] * V[j, a] + M[e, a] * V[j, 0]


@compiled
def step(row, column, reset, M, X, u, weights, order, substeps):  # noqa: PLR0917
    """
    Propagate x, its sensitivities and the output over one sample, with u held, eq. (20)–(23).

    The series Σ (A T/s)^k/k! acts on X itself, so no matrix exponential is formed. The held input
    is one more state that never changes; its powers vanish after the first.

    Parameters
    ----------
    row, column : (entries,) int arrays
        Places of the entries.
    reset : (r,) int array
        States that are zero when a sample begins.
    M : (entries, lanes) array
        Entries and derivatives, those of A and B times T/s.
    X : (n+1, lanes) array
        x and sensitivities; the last row is the output [ŷ ψ] and is written only.
    u : float
    weights : (≥ order,) array
        1/1!, 1/2!, …
    order, substeps : int
        Terms of the series, and substeps s of the sample.
    """
    n, lanes = len(X) - 1, X.shape[1]
    V, W = np.zeros((n + 1, lanes)), np.zeros((n + 1, lanes))
    for i in reset:
        for a in range(lanes):
            X[i, a] = 0.0
    for part in range(substeps + 1):
        for i in range(n + 1):
            for a in range(lanes):
                V[i, a] = X[i, a] if i < n else 0.0
        if part == substeps:  # the output is read at the end
            _product(row, column, M, V, W)
            for a in range(lanes):
                X[n, a] = W[n, a]
            break
        V[n, 0] = u
        for k in range(order):
            _product(row, column, M, V, W)
            for i in range(n):
                for a in range(lanes):
                    X[i, a] += weights[k] * W[i, a]
                    V[i, a] = W[i, a]
            V[n, 0] = 0.0
