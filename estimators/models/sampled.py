"""
Values and their derivatives side by side, and how they go through a model and over a sample.

A row of lanes [a, ∂a/∂θ_1, …, ∂a/∂θ_p] follows the product rule, a·v for the value and a·∂v + ∂a·v
for each derivative. `fill` and `step` do the whole of eq. (17)–(23) in such rows, for any model and
any of its parameters; `flexaxis.estimators.models.kernel` writes the same out for a pattern.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.compiler import compiled
from flexaxis.estimators.models.discretisation import MAX_ORDER, law_plan, plan
from flexaxis.estimators.models.parametrization import Parametrization

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


class _Solved(NamedTuple):
    """
    The laws of a model, and how they are solved.

    Attributes
    ----------
    kind, memory, drive, value, parameter
        As in `flexaxis.estimators.models.laws.Acting`.
    steps : int
        Parts of a sample, in each of which the torques of the laws are held.
    h : float
        Length of a part [s].
    cleared : (r,) int array
        States that are zero before the first part.
    """

    kind: NDArray[np.int64]
    memory: NDArray[np.int64]
    drive: Array
    value: Array
    parameter: NDArray[np.int64]
    steps: int
    h: float
    cleared: NDArray[np.int64]


class Terms(NamedTuple):
    """
    The terms c·Πθ^e of the block matrix [A B; C 0], as compiled code takes them.

    Attributes
    ----------
    row, column : (entries,) int arrays
        Places that are not zero.
    entry : (t,) int array
        Which of them a term belongs to.
    coefficient : (t,) array
        Factors of the terms, those of A and B times T/s.
    exponent : (t, p) int array
    reset : (r,) int array
        States that are zero at the start of every sample.
    n, order, substeps : int
        States; terms and substeps of the Taylor series, as from
        `flexaxis.estimators.models.discretisation.plan`.
    weights : (order,) array
        1/1!, 1/2!, …
    laws : Solved or None
        None for a linear model: its type tells the compiler to leave the laws out.
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    entry: NDArray[np.int64]
    coefficient: Array
    exponent: NDArray[np.int64]
    reset: NDArray[np.int64]
    n: int
    order: int
    substeps: int
    weights: Array
    laws: _Solved | None


def planned(model: Parametrization, lower: Array, upper: Array, period: float) -> Terms:
    """
    Return the terms of a model, to be sampled with a period [s] while θ stays in a box.

    Parameters
    ----------
    model : Parametrization
    lower, upper : (p,) arrays
    period : float
    """
    if model.laws is None:
        return terms(model, *plan(model, lower, upper, period), period)
    steps, order, substeps = law_plan(model, lower, upper, period)
    return terms(model, order, substeps, period / steps, steps=steps)


def terms(
    model: Parametrization, order: int, substeps: int, period: float, *, steps: int = 1
) -> Terms:
    """Return the terms of a model; period is that of a part [s], of which a sample has some."""
    places = np.column_stack([model.row, model.column])
    entries, entry = np.unique(places, axis=0, return_inverse=True)
    scale = np.where(model.row < model.n, period / substeps, 1.0)  # the output is read, not run
    return Terms(
        np.ascontiguousarray(entries[:, 0]),
        np.ascontiguousarray(entries[:, 1]),
        np.ascontiguousarray(entry.ravel()),
        model.coefficient * scale,
        np.ascontiguousarray(model.exponent),
        np.zeros(0, np.int64) if model.forces else _reset(model),
        model.n,
        order,
        substeps,
        1 / np.cumprod(np.arange(1.0, MAX_ORDER + 1)),
        None if model.laws is None else _Solved(*model.laws, steps, period, _reset(model)),
    )


def _reset(model: Parametrization) -> NDArray[np.int64]:
    return np.array(model.reset, np.int64)


@compiled
def sample(terms, theta, active):
    """
    Return the sampled system and its derivatives by some parameters.

    Parameters
    ----------
    terms : Terms
    theta : (p,) array
    active : (q,) int array
        Which parameters to differentiate by.

    Returns
    -------
    (1+q, n+1, n+1) array
        D[0] takes [x[k]; u[k]] to [x[k+1]; y[k+1]] for a torque held over the sample; D[1+i] is
        its derivative by parameter active[i]. Eq. (17)–(23): what a sample makes of each state,
        and of a torque, of one.
    """
    n, q = terms.n, len(active)
    M, D = np.zeros((len(terms.row), 1 + q)), np.zeros((1 + q, n + 1, n + 1))
    X = np.zeros((n + 1, 1 + q))
    fill(terms.entry, terms.exponent, terms.coefficient, theta, active, M)
    for column in range(n + 1):
        for i in range(n):
            for a in range(1 + q):
                X[i, a] = 1.0 if i == column and a == 0 else 0.0
        u = 1.0 if column == n else 0.0
        step(
            terms.row,
            terms.column,
            terms.reset,
            M,
            X,
            u,
            terms.weights,
            terms.order,
            terms.substeps,
        )
        for i in range(n + 1):
            for a in range(1 + q):
                D[a, i, column] = X[i, a]
    return D


@compiled
def move(D, X, moved, u):
    """
    Take states and sensitivities [x; y] over one sample; the place of y lends itself to u.

    Rows of X beyond those of D are sensitivities to what acts through the state alone, such as the
    state itself some time ago.
    """
    size = X.shape[1]
    X[0, size - 1] = u
    for a in range(1, len(X)):
        X[a, size - 1] = 0.0
    for i in range(size):
        total = 0.0
        for j in range(size):
            total += D[0, i, j] * X[0, j]
        moved[0, i] = total
        for a in range(1, len(D)):
            total = 0.0
            for j in range(size):
                total += D[0, i, j] * X[a, j] + D[a, i, j] * X[0, j]
            moved[a, i] = total
        for a in range(len(D), len(X)):
            total = 0.0
            for j in range(size):
                total += D[0, i, j] * X[a, j]
            moved[a, i] = total
