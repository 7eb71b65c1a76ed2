"""
Interacting multiple models: how likely each mode is, and how modes are mixed.

A mode is a joint filter; what differs between modes has a row for each, the first that of the quiet
one.
"""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.joint import Joint
from flexaxis.estimators.filters.state import NUMBERS
from flexaxis.estimators.models.compiler import embedded, fused, inlined
from flexaxis.estimators.models.memory import Cube, Matrix, Memory, Vector
from flexaxis.estimators.models.series import Axis

Array = NDArray[np.float64]

LEAST = 1e-30  # probability of a mode: from zero none comes back


class Modes(NamedTuple):
    """
    All modes, each with a row of most arrays; the model is the same.

    Attributes
    ----------
    now, axis, theta, X, P, G, GP, gain, drift, ceiling, lower, upper
        As of `flexaxis.estimators.filters.joint.Joint`.
    xi : (modes, m) array
        ξ = [θ; x].
    apart, mean : (m,) arrays
        Difference of two modes, and the mixture of all.
    mean_P : (m, w) array
        Covariance of the mixture.
    """

    now: Annotated[NDArray[np.void], NUMBERS, 1]
    axis: Axis
    theta: Matrix
    X: Cube
    P: Cube
    G: Cube
    GP: Cube
    gain: Matrix
    drift: Cube
    ceiling: Vector
    lower: Vector
    upper: Vector
    xi: Matrix
    apart: Vector
    mean: Vector
    mean_P: Matrix


def modes_of(arrays: dict[str, NDArray], count: int) -> Memory:
    """Return so many modes that begin as one joint filter, from the arrays of that."""
    own = ("now", "theta", "X", "P", "G", "GP", "gain", "drift")
    one = arrays | {"now": arrays["now"][0]}
    rows = {name: np.stack([one[name]] * count) for name in own}
    m = np.zeros_like(arrays["gain"])
    mixing = {"xi": np.stack([m] * count), "apart": m, "mean": m}
    return Memory({**arrays, **rows, **mixing, "mean_P": np.zeros_like(arrays["P"])})


@embedded
def mode(modes, j):
    """Return a mode as a joint filter."""
    return Joint(
        modes.now[j : j + 1],
        modes.axis,
        modes.theta[j],
        modes.X[j],
        modes.P[j],
        modes.G[j],
        modes.GP[j],
        modes.gain[j],
        modes.drift[j],
        modes.ceiling,
        modes.lower,
        modes.upper,
    )


@inlined
def mixture(now):
    """Return what the modes predict together, and the variance of that without noise."""
    mean, spread = 0.0, 0.0
    for j in range(len(now)):
        mean += now[j]["predicted"] * now[j]["output"]
    for j in range(len(now)):
        spread += now[j]["predicted"] * (now[j]["spread"] + (now[j]["output"] - mean) ** 2)
    return mean, spread


@inlined
def listen(now, y, noise):
    """Keep log Λ of the innovation of a mode, before it is used."""
    now["logarithm"] = 0.0
    if not np.isnan(y):
        S = now["spread"] + noise
        now["logarithm"] = -0.5 * (np.log(S) + (y - now["output"]) ** 2 / S)


@inlined
def weigh(now, theta, estimates):
    """μ_j ← c_j Λ_j over their sum; write the mean of η."""
    highest, total = -np.inf, 0.0
    for j in range(len(now)):
        highest = max(highest, now[j]["logarithm"])
    for j in range(len(now)):
        share = now[j]["predicted"] * np.exp(now[j]["logarithm"] - highest)
        now[j]["probability"] = share if share > LEAST else LEAST
        total += now[j]["probability"]
    for i in range(len(estimates)):
        estimates[i] = 0.0
    for j in range(len(now)):
        now[j]["probability"] /= total
        for i in range(len(estimates)):
            estimates[i] += now[j]["probability"] * theta[j, i]


@inlined
def mix(modes):
    """
    Give every mode the ξ⁰ and P⁰ from which it goes on.

    Two at a time, which is the same. A jump mode goes on from itself or quiet, the quiet one from
    all; the sum for it is kept beside it until the others no more need what it was. Π_0j is the
    same for all jumps j, and Π_jj is one less what goes back to quiet.
    """
    now, xi, P, apart = modes.now, modes.xi, modes.P, modes.apart
    quiet, p = now[0], modes.theta.shape[1]
    for j in range(len(now)):
        for a in range(p):
            xi[j, a] = modes.theta[j, a]
        for a in range(p, xi.shape[1]):
            xi[j, a] = modes.X[j, a - p, 0]
    for a in range(len(modes.mean)):
        modes.mean[a] = xi[0, a]
        for b in range(P.shape[2]):
            modes.mean_P[a, b] = P[0, a, b]
    total = quiet["stay"] * quiet["probability"]
    jump = (1.0 - quiet["stay"]) / (len(now) - 1) * quiet["probability"]
    for j in range(1, len(now)):
        weight = (1.0 - now[j]["stay"]) * now[j]["probability"]
        total += weight
        _join(modes.mean, modes.mean_P, xi[j], P[j], weight / total, apart)
    for j in range(1, len(now)):
        now[j]["predicted"] = jump + now[j]["stay"] * now[j]["probability"]
        _join(xi[j], P[j], xi[0], P[0], jump / now[j]["predicted"], apart)
    quiet["predicted"] = total
    for a in range(len(modes.mean)):
        xi[0, a] = modes.mean[a]
        for b in range(P.shape[2]):
            P[0, a, b] = modes.mean_P[a, b]
    for j in range(len(now)):
        for a in range(p):
            modes.theta[j, a] = xi[j, a]
        for a in range(p, xi.shape[1]):
            modes.X[j, a - p, 0] = xi[j, a]


@inlined
def _join(mean, P, other, other_P, share, apart):  # noqa: PLR0917
    """Take mean and covariance to those of a mixture with another mode, of weight ``share``."""
    for a in range(len(mean)):
        apart[a] = mean[a] - other[a]
        mean[a] -= share * apart[a]
    merge(share, P, other_P, apart)


@fused
def merge(share, P, other, apart):
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
    rest = 1.0 - share
    root = np.sqrt(share * rest)
    for a in range(len(apart)):
        for b in range(len(apart)):
            mine = rest * P[a, b] + share * other[a, b]
            P[a, b] = mine + (root * apart[a]) * (root * apart[b])


def read_mixture(state: Memory) -> tuple[Array, Array]:
    """Return η (p,) of the mixture of the modes, and its covariance (p, p)."""
    weights, theta = state["predicted"], state["theta"]  # both after mixing
    p = theta.shape[1]
    mean = weights @ theta
    apart = theta - mean
    covariance = np.einsum("j,jab->ab", weights, state["P"][:, :p, :p])
    return mean, covariance + np.einsum("j,ja,jb->ab", weights, apart, apart)
