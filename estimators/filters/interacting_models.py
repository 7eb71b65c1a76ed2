"""
Interacting multiple models: the probabilities of the modes, and the mixing of the modes.

Each mode is a joint filter. Arrays that differ between modes have one row per mode; the first row
belongs to the quiet mode.
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

LEAST = 1e-30  # smallest probability of a mode: a probability of zero could never recover


class Modes(NamedTuple):
    """
    The state of all modes; most arrays have one row per mode, but all modes share one model.

    Attributes
    ----------
    now, axis, theta, X, P, G, GP, gain, drift, ceiling, lower, upper
        Attributes of `flexaxis.estimators.filters.joint.Joint`.
    xi : (modes, m) array
        Vectors ξ = [θ; x] of the modes.
    apart, mean : (m,) arrays
        Difference between two modes, and mean of the mixture of all modes.
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
    """Return ``count`` modes that start as copies of one joint filter with the given arrays."""
    own = ("now", "theta", "X", "P", "G", "GP", "gain", "drift")
    one = arrays | {"now": arrays["now"][0]}
    rows = {name: np.stack([one[name]] * count) for name in own}
    m = np.zeros_like(arrays["gain"])
    mixing = {"xi": np.stack([m] * count), "apart": m, "mean": m}
    return Memory({**arrays, **rows, **mixing, "mean_P": np.zeros_like(arrays["P"])})


@embedded
def mode(modes, j):
    """Return mode j as a joint filter."""
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
    """Return the output predicted by the mixture, and its variance without noise."""
    mean, spread = 0.0, 0.0
    for j in range(len(now)):
        mean += now[j]["predicted"] * now[j]["output"]
    for j in range(len(now)):
        spread += now[j]["predicted"] * (now[j]["spread"] + (now[j]["output"] - mean) ** 2)
    return mean, spread


@inlined
def listen(now, y, noise):
    """Store the logarithm of the likelihood Λ of a mode's innovation before the update."""
    now["logarithm"] = 0.0
    if not np.isnan(y):
        S = now["spread"] + noise
        now["logarithm"] = -0.5 * (np.log(S) + (y - now["output"]) ** 2 / S)


@inlined
def weigh(now, theta, estimates):
    """Compute μ_j ← c_j Λ_j/Σ_i c_i Λ_i, and write the mean of η."""
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
    Compute the mixed ξ⁰ and P⁰ from which every mode continues.

    Modes are mixed two at a time, with the same result as mixing all at once. A jump mode continues
    from a mixture of itself and the quiet mode; the quiet mode continues from a mixture of all
    modes. The new quiet mode is stored separately until the old one is no longer needed. Π_0j is
    the same for all jump modes j, and Π_j0 = 1 − Π_jj.
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
    """Replace mean and covariance by those of a mixture with another mode of weight ``share``."""
    for a in range(len(mean)):
        apart[a] = mean[a] - other[a]
        mean[a] -= share * apart[a]
    merge(share, P, other_P, apart)


@fused
def merge(share, P, other, apart):
    """
    Compute the covariance of a mixture of two modes, P ← (1−s) P + s P' + s (1−s) d dᵀ.

    Parameters
    ----------
    share : float
        Weight s of the second mode.
    P, other : (m, w) arrays
        Covariances P and P' of the two modes; P is overwritten with the result.
    apart : (m,) array
        Difference d of the two means.
    """
    rest = 1.0 - share
    root = np.sqrt(share * rest)
    for a in range(len(apart)):
        for b in range(len(apart)):
            mine = rest * P[a, b] + share * other[a, b]
            P[a, b] = mine + (root * apart[a]) * (root * apart[b])


def read_mixture(state: Memory) -> tuple[Array, Array]:
    """Return η (p,) of the mixture of all modes, and the covariance (p, p) of η."""
    weights, theta = state["predicted"], state["theta"]  # both are values after mixing
    p = theta.shape[1]
    mean = weights @ theta
    apart = theta - mean
    covariance = np.einsum("j,jab->ab", weights, state["P"][:, :p, :p])
    return mean, covariance + np.einsum("j,ja,jb->ab", weights, apart, apart)
