"""
A model at fixed parameters, taken over samples with its sensitivities: linear or with laws.

Over a sample with the torque held it is a matrix and its derivatives. Of a model with laws that is
the matrix of a part of a sample, in which their torques are held; `travel` solves them in each.
Filters, whose parameters move, have `flexaxis.estimators.models.series` in its place.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.compiler import compiled, inlined
from flexaxis.estimators.models.discretisation import law_steps
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.models.reaction import assign, couple, drives, law_records, react
from flexaxis.estimators.models.rows import padded

Array = NDArray[np.float64]


class Prepared(NamedTuple):
    """
    A model at fixed parameters, as `travel` takes it.

    Attributes
    ----------
    D : (1+p, n+1, n+1) array
        As from `sampled`, of a part of a sample.
    laws, drive, square, lanes
        As from `flexaxis.estimators.models.reaction.law_records`, of 1+p+further lanes.
    cleared : (r,) int array
        States that are zero before the first part.
    steps : int
        Parts of a sample.
    h : float
        Length of a part [s].
    response : (L, n+1, lanes) array
        What a torque of one of each law adds in a part.
    X : (rows, n+1) array
        Room for states and sensitivities.
    Y : (n+1, lanes) array
        The same in columns.
    """

    D: Array
    laws: NDArray[np.void]
    drive: Array
    square: Array
    lanes: Array
    cleared: NDArray[np.int64]
    steps: int
    h: float
    response: Array
    X: Array
    Y: Array


def sampled(blocks: Array, period: float) -> Array:
    """
    Return what a sample makes of states and torque, with derivatives, eq. (17)–(23).

    Parameters
    ----------
    blocks : (1+p, n+1, n+1) array
        [A B; C 0] and its derivatives.
    period : float
        Of the sample [s].

    Returns
    -------
    (1+p, n+1, n+1) array
        D[0] takes [x[k]; u[k]] to [x[k+1]; y[k+1]]; D[1+i] is its derivative by θ_i. By C. F. Van
        Loan, *Computing integrals involving the matrix exponential*, IEEE Trans. AC 23 (1978).
    """
    from scipy.linalg import expm  # takes a tenth of a second to import

    n, output = blocks.shape[1] - 1, blocks[:, -1]
    pairs = np.zeros((max(len(blocks) - 1, 1), 2, n + 1, 2, n + 1))
    pairs[:, 0, :n, 0] = pairs[:, 1, :n, 1] = blocks[0, :n] * period
    pairs[: len(blocks) - 1, 0, :n, 1] = blocks[1:, :n] * period
    both = expm(pairs.reshape(len(pairs), 2 * n + 2, -1)).reshape(pairs.shape)
    D = np.concatenate([both[:1, 0, :, 0], both[: len(blocks) - 1, 0, :, 1]])
    D[:, n] = output[0] @ D
    D[1:, n] += output[1:] @ D[0]
    return D


def prepare(
    model: Parametrization,
    theta: ArrayLike,
    period: float,
    *,
    steps: int | None = None,
    further: int = 0,
) -> Prepared:
    """
    Return a model at θ (p,), with derivatives by it, ready to `travel`.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array_like
    period : float
        Sampling period [s].
    steps : int, optional
        Parts of a sample, of a model with laws; as many as filters take by default.
    further : int
        Rows of the states to come beyond 1+p, which `_move` has a word for.
    """
    theta, n, L = np.asarray(theta, float), model.n, model.forces
    steps = 1 if model.laws is None else steps or law_steps(model, period)
    D, reset = sampled(model.blocks(theta), period / steps), np.array(model.reset, np.int64)
    if not L:
        D[:, :, reset] = 0.0
    rows = len(D) + further
    known = law_records(model.laws, padded(rows))
    response = np.zeros((L, n + 1, padded(rows)))
    response[..., : len(D)] = D[:, :, n - L : n].T
    response[:, n - L : n] = 0.0
    assign(known["laws"], theta)
    couple(known["drive"], response, known["square"][0])
    X, Y = np.zeros((rows, n + 1)), np.zeros((n + 1, padded(rows)))
    return Prepared(
        D, **known, cleared=reset, steps=steps, h=period / steps, response=response, X=X, Y=Y
    )


@compiled
def travel(prepared, X, moved, u):
    """
    Take states and sensitivities [x; y] over one sample.

    Parameters
    ----------
    prepared : Prepared
    X, moved : (rows, n+1) arrays
        Before and after it; the place of y in X lends itself to u. With laws the last states are
        their torques, which are of no account.
    u : float
    """
    laws, drive, now, Y = prepared.laws, prepared.drive, prepared.X, prepared.Y
    L, n = len(laws), X.shape[1] - 1
    if L == 0:
        move(prepared.D, X, moved, u)
        return
    copy(X, now)
    for i in prepared.cleared:
        _clear(now, i, i + 1)
    for part in range(prepared.steps):
        _clear(now, n - L, n)
        _turn(now, Y)
        drives(drive, Y, u, prepared.lanes[0])
        move(prepared.D, now, moved, u)
        _turn(moved, Y)
        square, lanes = prepared.square, prepared.lanes
        react(laws, drive, square, lanes, prepared.h, prepared.response, u, Y)
        for a in range(len(moved)):
            for i in range(n + 1):
                moved[a, i] = Y[i, a]
        if part + 1 < prepared.steps:
            copy(moved, now)


@inlined
def _turn(X, Y):
    """Write rows into columns."""
    for a in range(len(X)):
        for i in range(X.shape[1]):
            Y[i, a] = X[a, i]


@compiled
def along(prepared, X, u):
    """Return output and sensitivities (N, rows) after each of N torques; X goes along."""
    moved, found = np.zeros_like(X), np.zeros((len(u), len(X)))
    for k in range(len(u)):
        travel(prepared, X, moved, u[k])
        copy(moved, X)
        for a in range(len(X)):
            found[k, a] = X[a, X.shape[1] - 1]
    return found


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
        for a in range(len(X)):
            total = 0.0
            for j in range(size):
                total += D[0, i, j] * X[a, j]
            if 0 < a < len(D):
                for j in range(size):
                    total += D[a, i, j] * X[0, j]
            moved[a, i] = total


@inlined
def _clear(X, first, end):
    """Set some columns to zero; a slice would take the compiler seconds."""
    for a in range(X.shape[0]):
        for j in range(first, end):
            X[a, j] = 0.0


@inlined
def copy(X, Y):
    """Y ← X."""
    for a in range(X.shape[0]):
        for j in range(X.shape[1]):
            Y[a, j] = X[a, j]
