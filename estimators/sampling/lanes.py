"""
Values and their derivatives side by side in the lanes of a vector register.

A row of lanes [a, ∂a/∂θ_1, …, ∂a/∂θ_p] follows the product rule,
``a·v = [a a … a]·v + [0 ∂a]·[v v … v]``, two vector instructions for the product and all of its
derivatives. `evaluate` and `advance` do the whole of eq. (17)–(23) in such rows. Each is a few
lines of NumPy, which say what it does and run where nothing is compiled; its twin for numba, in
`flexaxis.estimators.sampling.overloads`, emits straight-line code for the places where the matrices
are not zero.
"""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.sampling.pattern import Pattern, unflatten

Array = NDArray[np.float64]


def evaluate(flat: tuple[int, ...], coefficients: Array, theta: Array, M: Array) -> None:
    """
    Write the entries of [A B; C 0] that depend on θ, with their derivatives, into their rows of M.

    Parameters
    ----------
    flat : tuple of int
        The model's pattern, flat.
    coefficients : (terms,) array
    theta : (p,) array
    M : (entries, lanes) array
    """
    pattern = unflatten(flat)
    for entry, *_ in pattern.terms:
        M[entry] = 0.0
    for (entry, *exponents), c in zip(pattern.terms, coefficients, strict=True):
        e = np.array(exponents)
        M[entry, 0] += c * np.prod(theta**e)
        for i in np.flatnonzero(e):
            M[entry, 1 + i] += c * e[i] * np.prod(theta ** (e - (np.arange(len(e)) == i)))


def product(pattern: Pattern, M: Array, V: Array) -> Array:
    """Return the block matrix times V (n+1, lanes), by the product rule."""
    W = np.zeros_like(V)
    for (row, column, _), a in zip(pattern.entries, M, strict=True):
        W[row] += a[0] * V[column]
        W[row, 1:] += a[1:] * V[column, 0]
    return W


def advance(  # noqa: PLR0917
    flat: tuple[int, ...], M: Array, X: Array, u: float, weights: Array, order: int, substeps: int
) -> None:
    """
    Propagate x, its sensitivities and the output over one sample, with u held, eq. (20)–(23).

    The series Σ (A T/s)^k/k! acts on X itself, so no matrix exponential is formed. The held input
    is one more state that never changes; its powers vanish after the first.

    Parameters
    ----------
    flat : tuple of int
        The model's pattern, flat.
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
    pattern = unflatten(flat)
    X[list(pattern.reset)] = 0.0
    for _ in range(substeps):
        V = X.copy()
        V[-1] = 0.0
        V[-1, 0] = u
        for weight in weights[:order]:
            V = product(pattern, M, V)
            V[-1] = 0.0
            X[:-1] += weight * V[:-1]
    V = X.copy()
    V[-1] = 0.0
    X[-1] = product(pattern, M, V)[-1]
