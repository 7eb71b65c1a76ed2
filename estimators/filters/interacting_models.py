"""
Interacting multiple models: how likely each mode is, and how modes are mixed.

A mode is a joint filter with a block of memory of its own; the blocks are the rows of a matrix. The
first mode is the quiet one, beside which lies what mixing needs.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.covariance import merge
from flexaxis.estimators.filters.joint import JOINT_FIELDS, joint_in, look
from flexaxis.estimators.filters.noise import judge
from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.models.memory import Memory, items, matrix

Array = NDArray[np.float64]

LEAST = 1e-30  # probability of a mode: from zero none comes back


class Mixing(NamedTuple):
    """
    What mixing needs of a mode besides.

    Attributes
    ----------
    xi : (m,) array
        ξ = [θ; x].
    apart, mean : (m,) arrays
        Difference of two modes, and the mixture of all.
    P : (m, w) array
        Covariance of the mixture.
    """

    xi: Array
    apart: Array
    mean: Array
    P: Array


@inlined
def mixing_in(block, at):
    """Return what mixing needs of the block of a mode."""
    return Mixing(
        items(block, at[JOINT_FIELDS])[0],
        items(block, at[JOINT_FIELDS + 1])[0],
        items(block, at[JOINT_FIELDS + 2])[0],
        matrix(block, at[JOINT_FIELDS + 3])[0],
    )


def mixing_arrays(P: Array) -> dict[str, Array]:
    """Return the arrays of mixing for P (m, w)."""
    m = np.zeros(len(P))
    return {"mode_xi": m, "mode_apart": m, "mixture": m, "mixture_P": np.zeros_like(P)}


@inlined
def judge_together(blocks, at, y, valid):
    """Judge a sample by the mixture's prediction and its variance, in the first mode."""
    mean, spread = 0.0, 0.0
    for j in range(len(blocks)):
        state = joint_in(blocks[j], at)
        look(state)
        mean += state.now[0]["predicted"] * state.X[-1, 0]
    for j in range(len(blocks)):
        state = joint_in(blocks[j], at)
        now = state.now[0]
        spread += now["predicted"] * (now["spread"] + (state.X[-1, 0] - mean) ** 2)
    return judge(joint_in(blocks[0], at).now[0], y, valid, mean, spread)


@inlined
def listen(state, y, noise):
    """Keep log Λ of the innovation, before it is used."""
    now = state.now[0]
    now["logarithm"] = 0.0
    if not np.isnan(y):
        S = now["spread"] + noise
        now["logarithm"] = -0.5 * (np.log(S) + (y - state.X[-1, 0]) ** 2 / S)


@inlined
def weigh(blocks, at, estimates):
    """μ_j ← c_j Λ_j over their sum; write the mean of η."""
    highest, total = -np.inf, 0.0
    for j in range(len(blocks)):
        highest = max(highest, joint_in(blocks[j], at).now[0]["logarithm"])
    for j in range(len(blocks)):
        now = joint_in(blocks[j], at).now[0]
        share = now["predicted"] * np.exp(now["logarithm"] - highest)
        now["probability"] = share if share > LEAST else LEAST
        total += now["probability"]
    for i in range(len(estimates)):
        estimates[i] = 0.0
    for j in range(len(blocks)):
        state = joint_in(blocks[j], at)
        now = state.now[0]
        now["probability"] /= total
        for i in range(len(estimates)):
            estimates[i] += now["probability"] * state.theta[i]


@inlined
def mix(blocks, at):
    """
    Give every mode the ξ⁰ and P⁰ from which it goes on.

    Two at a time, which is the same. A jump mode goes on from itself or quiet, the quiet one from
    all; the sum for it is kept beside it until the others no more need what it was. Π_0j is the
    same for all jumps j, and Π_jj is one less what goes back to quiet.
    """
    modes = len(blocks)
    quiet, own = joint_in(blocks[0], at), mixing_in(blocks[0], at)
    now = quiet.now[0]
    _gather(quiet, own.xi)
    for a in range(len(own.mean)):
        own.mean[a] = own.xi[a]
        for b in range(quiet.P.shape[1]):
            own.P[a, b] = quiet.P[a, b]
    total = now["stay"] * now["probability"]
    jump = (1.0 - now["stay"]) / (modes - 1) * now["probability"]
    for j in range(1, modes):
        state, its = joint_in(blocks[j], at), mixing_in(blocks[j], at)
        _gather(state, its.xi)
        weight = (1.0 - state.now[0]["stay"]) * state.now[0]["probability"]
        total += weight
        _join(own.mean, own.P, its.xi, state.P, weight / total, own.apart)
    for j in range(1, modes):
        state, its = joint_in(blocks[j], at), mixing_in(blocks[j], at)
        one = state.now[0]
        one["predicted"] = jump + one["stay"] * one["probability"]
        _join(its.xi, state.P, own.xi, quiet.P, jump / one["predicted"], own.apart)
        _spread_out(state, its.xi)
    now["predicted"] = total
    for a in range(len(own.mean)):
        for b in range(quiet.P.shape[1]):
            quiet.P[a, b] = own.P[a, b]
    _spread_out(quiet, own.mean)


@inlined
def _join(mean, P, other, other_P, share, apart):  # noqa: PLR0917
    """Take mean and covariance to those of a mixture with another mode, of weight ``share``."""
    for a in range(len(mean)):
        apart[a] = mean[a] - other[a]
        mean[a] -= share * apart[a]
    merge(share, P, other_P, apart)


@inlined
def _gather(state, xi):
    """Write ξ = [θ; x]."""
    p = len(state.theta)
    for a in range(p):
        xi[a] = state.theta[a]
    for i in range(len(xi) - p):
        xi[p + i] = state.X[i, 0]


@inlined
def _spread_out(state, xi):
    """Write θ and x from ξ."""
    p = len(state.theta)
    for a in range(p):
        state.theta[a] = xi[a]
    for i in range(len(xi) - p):
        state.X[i, 0] = xi[p + i]


def read_mixture(state: Memory) -> tuple[Array, Array]:
    """Return η (p,) of the mixture of the modes, and its covariance (p, p)."""
    weights, theta = state["predicted"], state["theta"]  # both after mixing
    p = theta.shape[1]
    mean = weights @ theta
    apart = theta - mean
    covariance = np.einsum("j,jab->ab", weights, state["P"][:, :p, :p])
    return mean, covariance + np.einsum("j,ja,jb->ab", weights, apart, apart)
