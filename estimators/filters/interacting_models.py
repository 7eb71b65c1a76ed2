"""
Interacting multiple models: how likely each mode is, and how modes are mixed.

A mode is a joint filter with a block of memory of its own; the blocks are the rows of a matrix. The
first mode is the quiet one, beside which lies what mixing needs.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.covariance import merge
from flexaxis.estimators.filters.joint import JOINT_FIELDS
from flexaxis.estimators.filters.numbers import NUMBERS, WORDS
from flexaxis.estimators.models.compiler import embedded, inlined
from flexaxis.estimators.models.memory import Memory, items, matrix, records
from flexaxis.estimators.models.series import FIELDS

Array = NDArray[np.float64]

LEAST = 1e-30  # probability of a mode: from zero none comes back


class Mode(NamedTuple):
    """
    What mixing needs of a mode.

    Attributes
    ----------
    now, theta, X, P
        As of `flexaxis.estimators.filters.joint.Joint`.
    xi : (m,) array
        ξ = [θ; x].
    apart, mean : (m,) arrays
        Difference of two modes, and the mixture of all.
    mean_P : (m, w) array
        Covariance of the mixture.
    """

    now: NDArray[np.void]
    theta: Array
    X: Array
    P: Array
    xi: Array
    apart: Array
    mean: Array
    mean_P: Array


@embedded
def mode_in(block, at):
    """Return what mixing needs of the block of a mode."""
    return Mode(
        records(block, at[0], WORDS)[0].view(NUMBERS),
        items(block, at[1 + FIELDS])[0],
        matrix(block, at[2 + FIELDS])[0],
        matrix(block, at[3 + FIELDS])[0],
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
def mixture(blocks, at):
    """Return what the modes predict together, and the variance of that without noise."""
    mean, spread = 0.0, 0.0
    for j in range(len(blocks)):
        now = mode_in(blocks[j], at).now[0]
        mean += now["predicted"] * now["output"]
    for j in range(len(blocks)):
        now = mode_in(blocks[j], at).now[0]
        spread += now["predicted"] * (now["spread"] + (now["output"] - mean) ** 2)
    return mean, spread


@inlined
def listen(now, y, noise):
    """Keep log Λ of the innovation of a mode, before it is used."""
    now["logarithm"] = 0.0
    if not np.isnan(y):
        S = now["spread"] + noise
        now["logarithm"] = -0.5 * (np.log(S) + (y - now["output"]) ** 2 / S)


@inlined
def weigh(blocks, at, estimates):
    """μ_j ← c_j Λ_j over their sum; write the mean of η."""
    highest, total = -np.inf, 0.0
    for j in range(len(blocks)):
        highest = max(highest, mode_in(blocks[j], at).now[0]["logarithm"])
    for j in range(len(blocks)):
        now = mode_in(blocks[j], at).now[0]
        share = now["predicted"] * np.exp(now["logarithm"] - highest)
        now["probability"] = share if share > LEAST else LEAST
        total += now["probability"]
    for i in range(len(estimates)):
        estimates[i] = 0.0
    for j in range(len(blocks)):
        mode = mode_in(blocks[j], at)
        now = mode.now[0]
        now["probability"] /= total
        for i in range(len(estimates)):
            estimates[i] += now["probability"] * mode.theta[i]


@inlined
def mix(blocks, at):
    """
    Give every mode the ξ⁰ and P⁰ from which it goes on.

    Two at a time, which is the same. A jump mode goes on from itself or quiet, the quiet one from
    all; the sum for it is kept beside it until the others no more need what it was. Π_0j is the
    same for all jumps j, and Π_jj is one less what goes back to quiet.
    """
    modes, quiet = len(blocks), mode_in(blocks[0], at)
    now = quiet.now[0]
    _gather(quiet)
    for a in range(len(quiet.mean)):
        quiet.mean[a] = quiet.xi[a]
        for b in range(quiet.P.shape[1]):
            quiet.mean_P[a, b] = quiet.P[a, b]
    total = now["stay"] * now["probability"]
    jump = (1.0 - now["stay"]) / (modes - 1) * now["probability"]
    for j in range(1, modes):
        mode = mode_in(blocks[j], at)
        _gather(mode)
        weight = (1.0 - mode.now[0]["stay"]) * mode.now[0]["probability"]
        total += weight
        _join(quiet.mean, quiet.mean_P, mode.xi, mode.P, weight / total, quiet.apart)
    for j in range(1, modes):
        mode = mode_in(blocks[j], at)
        one = mode.now[0]
        one["predicted"] = jump + one["stay"] * one["probability"]
        _join(mode.xi, mode.P, quiet.xi, quiet.P, jump / one["predicted"], quiet.apart)
        _spread_out(mode, mode.xi)
    now["predicted"] = total
    for a in range(len(quiet.mean)):
        for b in range(quiet.P.shape[1]):
            quiet.P[a, b] = quiet.mean_P[a, b]
    _spread_out(quiet, quiet.mean)


@inlined
def _join(mean, P, other, other_P, share, apart):  # noqa: PLR0917
    """Take mean and covariance to those of a mixture with another mode, of weight ``share``."""
    for a in range(len(mean)):
        apart[a] = mean[a] - other[a]
        mean[a] -= share * apart[a]
    merge(share, P, other_P, apart)


@inlined
def _gather(mode):
    """Write ξ = [θ; x]."""
    p = len(mode.theta)
    for a in range(p):
        mode.xi[a] = mode.theta[a]
    for i in range(len(mode.xi) - p):
        mode.xi[p + i] = mode.X[i, 0]


@inlined
def _spread_out(mode, xi):
    """Write θ and x from ξ."""
    p = len(mode.theta)
    for a in range(p):
        mode.theta[a] = xi[a]
    for i in range(len(xi) - p):
        mode.X[i, 0] = xi[p + i]


def read_mixture(state: Memory) -> tuple[Array, Array]:
    """Return η (p,) of the mixture of the modes, and its covariance (p, p)."""
    weights, theta = state["predicted"], state["theta"]  # both after mixing
    p = theta.shape[1]
    mean = weights @ theta
    apart = theta - mean
    covariance = np.einsum("j,jab->ab", weights, state["P"][:, :p, :p])
    return mean, covariance + np.einsum("j,ja,jb->ab", weights, apart, apart)
