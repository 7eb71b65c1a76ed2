"""Triangular factors of covariances, in compiled code: the steps that square-root filters share."""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.sampling.compiler import inlined
from flexaxis.estimators.sampling.symmetric import NOTHING


@inlined
def triangularize(A, rows, columns):
    """
    Make A (rows, columns), rows ≥ columns, upper triangular without a change of AᵀA (Householder).

    The diagonal becomes non-negative, so that the result is the transposed Cholesky factor of AᵀA.
    What lies below the diagonal is left undefined. G. H. Golub and C. F. Van Loan, *Matrix
    Computations*, section 5.2.
    """
    for j in range(columns):
        square = 0.0
        for i in range(j, rows):
            square += A[i, j] ** 2
        if square <= NOTHING:
            continue
        norm = np.sqrt(square)
        alpha = -norm if A[j, j] > 0.0 else norm
        A[j, j] -= alpha
        scale = 1.0 / (alpha * A[j, j])  # −2/vᵀv, with v what lies in column j now
        for m in range(j + 1, columns):
            total = 0.0
            for i in range(j, rows):
                total += A[i, j] * A[i, m]
            total *= scale
            for i in range(j, rows):
                A[i, m] += total * A[i, j]
        A[j, j] = alpha
        if alpha < 0.0:
            for m in range(j, columns):
                A[j, m] = -A[j, m]


@inlined
def cholesky(A):
    """Put L with L Lᵀ = A into the lower triangle of A (m, m); NaN where A is not positive."""
    for i in range(len(A)):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= A[i, k] * A[j, k]
            A[i, j] = np.sqrt(total) if i == j else total / A[j, j]


@inlined
def forward(L, B):
    """B ← L⁻¹ B for B (m, c) and the lower triangle of L (m, m)."""
    for c in range(B.shape[1]):
        for i in range(len(L)):
            for k in range(i):
                B[i, c] -= L[i, k] * B[k, c]
            B[i, c] /= L[i, i]


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
