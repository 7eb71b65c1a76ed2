"""A model sampled exactly at any parameters, with derivatives by some of them, in compiled code."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.model import Parametrization
from flexaxis.estimators.sampling.compiler import compiled

Array = NDArray[np.float64]


class Terms(NamedTuple):
    """
    The terms c·Πθ^e of the block matrix [A B; C 0], as compiled code takes them.

    Attributes
    ----------
    row, column : (t,) int arrays
    coefficient : (t,) array
    exponent : (t, p) int array
    reset : (r,) int array
        States that are zero at the start of every sample.
    n, order, substeps : int
        States; terms and substeps of the Taylor series, as from
        `flexaxis.estimators.sampling.plan.plan`.
    period : float
        Sampling period [s].
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    coefficient: Array
    exponent: NDArray[np.int64]
    reset: NDArray[np.int64]
    n: int
    order: int
    substeps: int
    period: float


def terms(model: Parametrization, order: int, substeps: int, period: float) -> Terms:
    """Return the terms of a model."""
    return Terms(
        np.ascontiguousarray(model.row),
        np.ascontiguousarray(model.column),
        np.ascontiguousarray(model.coefficient),
        np.ascontiguousarray(model.exponent),
        np.array(model.reset, np.int64),
        model.n,
        order,
        substeps,
        period,
    )


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
        its derivative by parameter active[i]. Eq. (17)–(23), by the Taylor series.
    """
    n, q = terms.n, len(active)
    block = _block(terms, theta, active)
    shape = 1 + q, n + 1, n + 1
    small, power, next_power = np.zeros(shape), np.zeros(shape), np.empty(shape)
    output = _held(block, terms.period / terms.substeps)
    for i in range(n + 1):
        small[0, i, i] = power[0, i, i] = 1.0
    for k in range(1, terms.order + 1):
        _product(block, power, next_power)
        power, next_power = next_power, power
        if not _add(power, 1.0 / k, small):
            break  # what is left is below rounding
    D = power
    for a in range(1 + q):
        for i in range(n + 1):
            for m in range(n + 1):
                D[a, i, m] = small[a, i, m]
    for _ in range(terms.substeps - 1):
        _product(small, D, next_power)
        D, next_power = next_power, D
    for i in terms.reset:
        for a in range(1 + q):
            for m in range(n + 1):
                D[a, m, i] = 0.0
    _put_output(output, D)
    return D


# Loops where NumPy's assignment to slices would read better: with its messages on shapes that do
# not fit, it takes longer to compile than all the rest.
@compiled
def _held(block, duration):
    """Take the output (1+q, n+1) out of a block, for the held input does not change; scale it."""
    q, n = block.shape[0], block.shape[1] - 1
    output = np.empty((q, n + 1))
    for a in range(q):
        for m in range(n + 1):
            output[a, m] = block[a, n, m]
            block[a, n, m] = 0.0
            for i in range(n):
                block[a, i, m] *= duration
    return output


@compiled
def _put_output(output, D):
    """Put the output into the last row, the place of the input."""
    n = D.shape[1] - 1
    for m in range(n + 1):
        for a in range(len(D)):
            total = 0.0
            for j in range(n):
                total += output[0, j] * D[a, j, m]
                if a:
                    total += output[a, j] * D[0, j, m]
            D[a, n, m] = total


@compiled
def _add(term, factor, total):
    """Scale a term of a series and add it to the sum; return whether that changed anything."""
    changed = False
    for a in range(total.shape[0]):
        for i in range(total.shape[1]):
            for m in range(total.shape[2]):
                before = total[a, i, m]
                term[a, i, m] *= factor
                total[a, i, m] += term[a, i, m]
                changed |= total[a, i, m] != before
    return changed


@compiled
def _block(terms, theta, active):
    """Return [A B; C 0] and its derivatives by the active parameters, (1+q, n+1, n+1)."""
    block = np.zeros((1 + len(active), terms.n + 1, terms.n + 1))
    for t in range(len(terms.row)):
        row, column = terms.row[t], terms.column[t]
        for a in range(-1, len(active)):
            lowered = active[a] if a >= 0 else -1
            if a >= 0 and terms.exponent[t, lowered] == 0:
                continue
            value = terms.coefficient[t]
            for i in range(len(theta)):
                e = terms.exponent[t, i]
                if i == lowered:  # the derivative, which is finite where θ is zero
                    value = value * e
                    e -= 1
                for _ in range(abs(e)):
                    value = value * theta[i] if e > 0 else value / theta[i]
            block[1 + a, row, column] += value
    return block


@compiled
def _product(F, G, H):
    """H ← F G for matrices with derivatives, by the product rule; zeros of F are skipped."""
    for a in range(len(H)):
        for i in range(H.shape[1]):
            for m in range(H.shape[2]):
                H[a, i, m] = 0.0
    for i in range(F.shape[1]):
        for j in range(F.shape[2]):
            f = F[0, i, j]
            if f != 0.0:
                for a in range(len(G)):
                    for m in range(G.shape[2]):
                        H[a, i, m] += f * G[a, j, m]
            for a in range(1, len(G)):
                f = F[a, i, j]
                if f != 0.0:
                    for m in range(G.shape[2]):
                        H[a, i, m] += f * G[0, j, m]


@compiled
def move(D, X, moved, u):
    """Take states and sensitivities [x; y] over one sample; the place of y lends itself to u."""
    size = X.shape[1]
    X[0, size - 1] = u
    for a in range(1, len(X)):
        X[a, size - 1] = 0.0
    for i in range(size):
        total = 0.0
        for j in range(size):
            total += D[0, i, j] * X[0, j]
        moved[0, i] = total
        for a in range(1, len(X)):
            total = 0.0
            for j in range(size):
                total += D[0, i, j] * X[a, j] + D[a, i, j] * X[0, j]
            moved[a, i] = total
