"""
Operations on matrix rows whose lengths are multiples of four.

Each operation processes four numbers at a time, so that the compiler can use vector instructions.
Indices are unsigned, because checking signed indices for negative values would prevent
vectorisation.
"""

from functools import partial

import numpy as np

from flexaxis.estimators.models.compiler import Compiled

ZERO, ONE, TWO, THREE, FOUR = (np.uint64(i) for i in range(5))


_on_rows = partial(Compiled, fastmath={"contract"}, forceinline=True)  # inlined by all callers


def padded(m: int) -> int:
    """Return the row length for m numbers, which is m rounded up to a multiple of four."""
    return -4 * (-m // 4)


@_on_rows
def copy(A, i, B, j):
    """Copy a row: A_i ← B_j."""
    i, j = np.uint64(i), np.uint64(j)
    for b in range(np.uint64(A.shape[1])):
        A[i, b] = B[j, b]


@_on_rows
def add(A, i, m, B, j):
    """Add a multiple of row B_j to row A_i: A_i ← A_i + m B_j."""
    i, j = np.uint64(i), np.uint64(j)
    for b in range(ZERO, np.uint64(A.shape[1]), FOUR):
        p, q, r, s = A[i, b], A[i, b + ONE], A[i, b + TWO], A[i, b + THREE]
        v, w, x, y = B[j, b], B[j, b + ONE], B[j, b + TWO], B[j, b + THREE]
        A[i, b], A[i, b + ONE] = p + m * v, q + m * w
        A[i, b + TWO], A[i, b + THREE] = r + m * x, s + m * y


@_on_rows
def add_slopes(A, i, m, B, j):
    """Add m B_j to row A_i, but not to its first element, which is not a derivative."""
    if m != 0.0:
        value = A[i, 0]
        add(A, i, m, B, j)
        A[i, 0] = value


@_on_rows
def product(A, i, M, at, column, B, first, step, count):  # noqa: PLR0917
    """Compute the sum A_i ← Σ_j M_(at + j, column) B_(first + j step) over ``count`` rows of B."""
    i, at, column = np.uint64(i), np.uint64(at), np.uint64(column)
    first, step = np.uint64(first), np.uint64(step)
    for b in range(ZERO, np.uint64(A.shape[1]), FOUR):
        p = q = r = s = 0.0
        for j in range(np.uint64(count)):
            m, of = M[at + j, column], first + j * step
            p += m * B[of, b]
            q += m * B[of, b + ONE]
            r += m * B[of, b + TWO]
            s += m * B[of, b + THREE]
        A[i, b], A[i, b + ONE], A[i, b + TWO], A[i, b + THREE] = p, q, r, s


@partial(Compiled, _nrt=True)
def multiply(A, B, C):
    """Compute C ← A B with NumPy's BLAS."""
    np.dot(A, B, C)
