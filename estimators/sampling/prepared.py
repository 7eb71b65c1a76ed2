"""
A model at fixed parameters, taken over samples with its sensitivities: linear or with laws.

`prepare` and `travel` are to a model with laws what `flexaxis.estimators.sampling.sampled.sample`
and `move` are to a linear one: the matrix is that of a part of a sample in which the torques of the
laws are held, and the laws are solved in each part.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.sampling.compiler import compiled, inlined
from flexaxis.estimators.sampling.forces import WIDTH
from flexaxis.estimators.sampling.reaction import assign, couple, drives, react
from flexaxis.estimators.sampling.sampled import move, sample

Array = NDArray[np.float64]


class Prepared(NamedTuple):
    """
    A model at fixed parameters, as `travel` takes it.

    Attributes
    ----------
    D : (1+q, n+1, n+1) array
        As from `sample`, of a part of a sample.
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
        Room, as `flexaxis.estimators.sampling.reaction.room` has it.
    """

    D: Array
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
    L, n, lanes = len(terms.kind), terms.n, 1 + len(active) + further
    response = np.zeros((L, n + 1, lanes))
    for i in range(L):
        for m in range(n + 1):
            if m < n - L or m == n:
                for a in range(len(D)):
                    response[i, m, a] = D[a, m, n - L + i]
    lane = np.full((L, terms.parameter.shape[1]), -1)
    for i in range(L):
        for r in range(lane.shape[1]):
            for a in range(len(active)):
                if terms.parameter[i, r] == active[a]:
                    lane[i, r] = a
    roles, coupling = np.zeros((L, terms.value.shape[1])), np.zeros((L, L))
    assign(terms.value, terms.parameter, theta, roles)
    couple(terms.drive, response, coupling)
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
    return Prepared(
        D,
        terms.kind,
        terms.memory,
        terms.drive,
        terms.value,
        lane,
        terms.cleared,
        terms.steps,
        terms.h,
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
    L, n = len(prepared.kind), X.shape[1] - 1
    if L == 0:
        move(prepared.D, X, moved, u)
        return
    now = prepared.X
    copy(X, now)
    for i in prepared.cleared:
        clear(now, i, i + 1)
    laws = prepared.kind, prepared.memory, prepared.drive, prepared.value, prepared.lane
    for part in range(prepared.steps):
        clear(now, n - L, n)
        drives(prepared.drive, now.T, u, prepared.work[8])
        move(prepared.D, now, moved, u)
        react(laws, prepared.h, prepared.response, u, moved.T, prepared.work)
        if part + 1 < prepared.steps:
            copy(moved, now)


@inlined
def clear(X, first, end):
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
