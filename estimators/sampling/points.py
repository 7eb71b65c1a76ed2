"""
Points side by side in rows of lanes, each with its own parameters, and how they go over a sample.

`place` and `convey` say what is done; their twins, in `flexaxis.estimators.sampling.overloads`,
emit straight-line code for the places where the matrices are not zero.
"""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.sampling.pattern import unflatten

Array = NDArray[np.float64]


def place(flat: tuple[int, ...], coefficients: Array, theta: Array, M: Array) -> None:
    """
    Write the entries of [A B; C 0] that depend on θ, at every point.

    Parameters
    ----------
    flat : tuple of int
        The model's pattern, flat.
    coefficients : (terms,) array
    theta : (p, lanes) array
        None of them zero.
    M : (entries, lanes) array
    """
    terms = unflatten(flat).terms
    for entry, *_ in terms:
        M[entry] = 0.0
    for c, (entry, *exponents) in zip(coefficients, terms, strict=True):
        M[entry] += c * np.prod(theta ** np.array(exponents, float)[:, None], axis=0)


def convey(  # noqa: PLR0917
    flat: tuple[int, ...],
    M: Array,
    X: Array,
    inputs: Array,
    weights: Array,
    order: int,
    substeps: int,
) -> None:
    """
    Take every point over one sample, with its input held, by the Taylor series of the exact step.

    Parameters
    ----------
    flat : tuple of int
        The model's pattern, flat.
    M : (entries, lanes) array
        Those of A and B times T/s.
    X : (n+1, lanes) array
        States; the last row is the output, which is written only.
    inputs : (lanes,) array
    weights, order, substeps
        As for `flexaxis.estimators.sampling.lanes.step`.
    """
    pattern = unflatten(flat)
    full = np.zeros((X.shape[1], pattern.n + 1, pattern.n + 1))
    for values, (row, column, _) in zip(M, pattern.entries, strict=True):
        full[:, row, column] = values
    state = np.vstack([X[:-1], np.zeros(X.shape[1])])
    state[list(pattern.reset)] = 0.0
    for _ in range(substeps):
        power = np.vstack([state[:-1], inputs])
        for k in range(order):
            power = np.einsum("lij,jl->il", full, power)
            power[-1] = 0.0
            state += weights[k] * power
    X[:] = state
    X[-1] = np.einsum("lj,jl->l", full[:, -1], state)
