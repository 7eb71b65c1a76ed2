"""
Covariances in rows of vector registers: over a sample, through a measurement, mixed, and roots.

P is that of ξ = [θ; x], p parameters and n states, m = p + n of them: (m, w) with w from `padded`;
what pads a row is zero. In a sample θ stays and x moves, ξ⁺ = F ξ with F = [I 0; G], so that its
block θθ only gains W. X (> n, ≥ 1+m) has G behind its first lane, rows of no account below it, and
in its last row h, the derivative of the output. What is symmetric stays so to the last bit.

These functions say what is done; `flexaxis.estimators.sampling.symmetric_code` has their twins for
the compiler, straight-line code for sizes that it takes from the shapes of X, of W and of what is
of length m.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NOTHING = 1e-290  # a square of which the inverse, nearly, is no number: a column of it is none


def padded(m: int) -> int:
    """Return the length of the row of a covariance: whole registers of four."""
    return -4 * (-m // 4)


def look(X: Array, P: Array, Ph: Array) -> float:
    """
    Write P h, and return hᵀPh.

    Parameters
    ----------
    X, P
        As above.
    Ph : (m,) array
    """
    h = X[-1, 1 : 1 + len(Ph)]
    Ph[:] = P[:, : len(Ph)] @ h
    return float(h @ Ph)


def carry(  # noqa: PLR0917
    X: Array, Ph: Array, root: float, W: Array, P: Array, gain: Array
) -> None:
    """
    Take P over a sample and through its measurement: P ← F P Fᵀ + W − k kᵀ, k = F P h·root.

    Parameters
    ----------
    X, Ph, P
        As for `look`.
    root : float
        1/√S of the innovation; 0 where there is no measurement.
    W : (p, p) array
        What the covariance of θ gains.
    gain : (m,) array
        k, written.
    """
    m, p = len(gain), len(W)
    F = np.eye(m)
    F[p:] = X[: m - p, 1 : 1 + m]
    gain[:] = F @ Ph * root
    moved = F @ P[:, :m] @ F.T
    moved[:p, :p] += W
    P[:, :m] = np.tril(moved) + np.tril(moved, -1).T - np.outer(gain, gain)


def merge(share: float, P: Array, other: Array, apart: Array) -> None:
    """
    P ← (1−s) P + s P' + s (1−s) d dᵀ, the covariance of a mixture of two.

    Parameters
    ----------
    share : float
        s, the weight of the other.
    P, other : (m, w) arrays
    apart : (m,) array
        d, the difference of their means.
    """
    e = np.zeros(P.shape[1])
    e[: len(apart)] = np.sqrt(share * (1 - share)) * apart
    P[:] = (1 - share) * P + share * other + np.outer(e[: len(P)], e)


def triangularize_columns(A: Array, R: Array) -> None:
    """
    Write the transposed Cholesky factor R, upper triangular, of A Aᵀ (Householder).

    As `flexaxis.estimators.recursion.square_root.triangularize` does of Aᵀ.

    Parameters
    ----------
    A : (c, r) array
        Columns of what is triangularised, as rows; r a multiple of four.
    R : (c, c) array
        What is below the diagonal is left as it is.
    """
    root = np.linalg.qr(A.T)[1]
    above = np.triu_indices(len(R))
    R[above] = (root * np.where(np.diag(root) < 0, -1.0, 1.0)[:, None])[above]
