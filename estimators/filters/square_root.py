"""Triangular factors of covariances, in compiled code: the steps that square-root filters share."""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.compiler import fused, inlined

NOTHING = 1e-290  # a square of which the inverse, nearly, is no number: a column of it is none


@fused
def triangularize(A, R):
    """
    Write the transposed Cholesky factor R, upper triangular, of A Aᵀ (Householder); A is lost.

    G. H. Golub and C. F. Van Loan, *Matrix Computations*, section 5.2.

    Parameters
    ----------
    A : (c, r) array
        Columns of what is triangularised, as rows, r ≥ c.
    R : (c, c) array
        What is below the diagonal is left as it is.
    """
    columns, rows = A.shape
    for j in range(columns):
        square = 0.0
        for i in range(j, rows):
            square += A[j, i] ** 2
        norm = np.sqrt(square)
        alpha = -norm if A[j, j] > 0.0 else norm
        sign = -1.0 if alpha < 0.0 else 1.0
        A[j, j] -= alpha
        scale = 1.0 / (alpha * A[j, j]) if square > NOTHING else 0.0  # −2/vᵀv, with v this column
        R[j, j] = norm
        for m in range(j + 1, columns):
            total = 0.0
            for i in range(j, rows):
                total += A[j, i] * A[m, i]
            total *= scale
            for i in range(j, rows):
                A[m, i] += total * A[j, i]
            R[j, m] = sign * A[m, j]


@inlined
def bound_root(S, ceiling, R):
    """Scale the columns of S for which a variance of R SᵀS is above its ceiling (p,) down to it."""
    for i in range(len(ceiling)):
        variance = 0.0
        for j in range(i + 1):
            variance += R * S[j, i] ** 2
        if variance > ceiling[i]:
            factor = np.sqrt(ceiling[i] / variance)
            for j in range(i + 1):
                S[j, i] *= factor


def triangular_root(P: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an upper triangular S with SᵀS = P, for P (m, m) that may be singular."""
    values, vectors = np.linalg.eigh(P)
    return np.linalg.qr(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)[1]
