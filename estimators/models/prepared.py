"""
A model at fixed parameters, taken over samples with its sensitivities: linear or with laws.

`prepare` and `travel` are to a model with laws what `flexaxis.estimators.models.sampled.sample`
and `move` are to a linear one: the matrix is that of a part of a sample in which the torques of the
laws are held, and the laws are solved in each part.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.compiler import compiled, inlined
from flexaxis.estimators.models.forces import WIDTH
from flexaxis.estimators.models.reaction import assign, couple, drives, react
from flexaxis.estimators.models.sampled import move, sample

Array = NDArray[np.float64]


class _Ready(NamedTuple):
    """
    The laws of a model at fixed parameters.

    Attributes
    ----------
    kind, memory, drive, value, lane
        The laws; factor and lane (less one) of each role with respect to the active parameters.
    cleared : (r,) int array
    steps : int
    h : float
    response : (L, n+1, rows) array
        What a torque of one of each law adds in a part.
    X : (rows, n+1) array
        Room for states and sensitivities.
    work : tuple of arrays
        Room, as `flexaxis.estimators.models.reaction.room` has it.
    """

    kind: NDArray[np.int64]
    memory: NDArray[np.int64]
    drive: Array
    value: Array
    lane: NDArray[np.int64]
    cleared: NDArray[np.int64]
    steps: int
    h: float
    response: Array
    X: Array
    work: tuple[Array, ...]


class Prepared(NamedTuple):
    """
    A model at fixed parameters, as `travel` takes it.

    Attributes
    ----------
    D : (1+q, n+1, n+1) array
        As from `sample`, of a part of a sample.
    laws : Ready or None
        None for a linear model.
    """

    D: Array
    laws: _Ready | None


@compiled
def prepare(terms, theta, active, further=0):
    """
    Return a model at θ, with derivatives by some parameters, ready to `travel`.

    Parameters
    ----------
    terms : Terms
    theta : (p,) array
    active : (q,) int array
        Which parameters to differentiate by.
    further : int
        Rows of the states to come beyond those, which `move` has a word for.
    """
    D = sample(terms, theta, active)
    return Prepared(D, _ready(terms.laws, terms.n, theta, active, D, further))


@compiled
def _ready(laws, n, theta, active, D, further):  # noqa: PLR0917
    """Return laws at θ, None for none, which the compiler knows from the type."""
    if laws is None:
        return None
    return _laws_ready(laws, n, theta, active, D, further)


@compiled
def _laws_ready(laws, n, theta, active, D, further):  # noqa: PLR0917
    """Return the `_Ready` of a model that has laws."""
    L, lanes = len(laws.kind), 1 + len(active) + further
    response = np.zeros((L, n + 1, lanes))
    for i in range(L):
        for m in range(n + 1):
            if m < n - L or m == n:
                for a in range(len(D)):
                    response[i, m, a] = D[a, m, n - L + i]
    lane = np.full((L, laws.parameter.shape[1]), -1)
    for i in range(L):
        for r in range(lane.shape[1]):
            for a in range(len(active)):
                if laws.parameter[i, r] == active[a]:
                    lane[i, r] = a
    roles, coupling = np.zeros((L, laws.value.shape[1])), np.zeros((L, L))
    assign(laws.value, laws.parameter, theta, roles)
    couple(laws.drive, response, coupling)
    work = (
        np.zeros(L),
        np.zeros(L),
        np.zeros(L),
        roles,
        np.zeros((L, WIDTH)),
        coupling,
        np.zeros((L, L)),
        np.zeros((L, L)),
        np.zeros((L, lanes)),
        np.zeros((L, lanes)),
        np.zeros((L, lanes)),
        np.zeros(L),
    )
    return _Ready(
        laws.kind,
        laws.memory,
        laws.drive,
        laws.value,
        lane,
        laws.cleared,
        laws.steps,
        laws.h,
        response,
        np.zeros((lanes, n + 1)),
        work,
    )


@compiled
def travel(prepared, X, moved, u):
    """
    Take states and sensitivities [x; y] over one sample, as `move` does.

    Parameters
    ----------
    prepared : Prepared
    X, moved : (rows, n+1) arrays
        Before and after it; the place of y in X lends itself to u. With laws the last states are
        their torques, which are of no account.
    u : float
    """
    _travel(prepared.laws, prepared.D, X, moved, u)


@compiled
def _travel(laws, D, X, moved, u):
    if laws is None:  # known to the compiler, which leaves out the rest
        move(D, X, moved, u)
        return
    L, n = len(laws.kind), X.shape[1] - 1
    now = laws.X
    copy(X, now)
    for i in laws.cleared:
        _clear(now, i, i + 1)
    act = laws.kind, laws.memory, laws.drive, laws.value, laws.lane
    for part in range(laws.steps):
        _clear(now, n - L, n)
        drives(laws.drive, now.T, u, laws.work[8])
        move(D, now, moved, u)
        react(act, laws.h, laws.response, u, moved.T, laws.work)
        if part + 1 < laws.steps:
            copy(moved, now)


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
