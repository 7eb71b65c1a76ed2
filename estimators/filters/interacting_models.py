"""
The interacting-multiple-model filter: mode probabilities and mixing of the modes.

Each mode is a Kalman filter that estimates the state and the parameters (`joint`). Each array that
differs between modes contains one row for each mode. The first row belongs to the quiet mode, which
assumes that no parameter jumps.
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
    The state of all modes, which share one model; most arrays contain one row for each mode.

    Attributes
    ----------
    now, axis, theta, X, drift, lower, upper, P, G, GP, gain, ceiling : arrays
        The attributes of `flexaxis.estimators.filters.joint.Joint`, with one row for each mode. An
        additional row stores a copy of the quiet mode while the modes are mixed.
    apart : (m,) array
        Difference between the estimates ξ of two modes.
    """

    now: Annotated[NDArray[np.void], NUMBERS, 1]
    axis: Axis
    theta: Matrix
    X: Cube
    drift: Cube
    lower: Vector
    upper: Vector
    P: Cube
    G: Cube
    GP: Cube
    gain: Matrix
    ceiling: Vector
    apart: Vector


def modes_of(arrays: dict[str, NDArray], count: int) -> Memory:
    """Return ``count`` modes that start as copies of the joint filter with the given arrays."""
    own = ("theta", "X", "drift", "P", "G", "GP", "gain")
    rows = {name: np.stack([arrays[name]] * (count + 1)) for name in own}
    rows["now"] = np.repeat(arrays["now"], count)
    return Memory(arrays | rows | {"apart": np.zeros_like(arrays["gain"])})


@embedded
def mode(modes, j):
    """Return mode j of the filter as a joint filter."""
    return Joint(
        modes.now[j : j + 1],
        modes.axis,
        modes.theta[j],
        modes.X[j],
        modes.drift[j],
        modes.lower,
        modes.upper,
        modes.P[j],
        modes.G[j],
        modes.GP[j],
        modes.gain[j],
        modes.ceiling,
    )


@inlined
def mixture(now, X):
    """Return the mean of the output over all modes, and its variance without sensor noise."""
    mean, spread = 0.0, 0.0
    for j in range(len(now)):
        mean += now[j]["predicted"] * X[j, -1, 0]
    for j in range(len(now)):
        spread += now[j]["predicted"] * (now[j]["spread"] + (X[j, -1, 0] - mean) ** 2)
    return mean, spread


@inlined
def weigh(modes, y, noise, estimates):
    """
    Compute the mode probabilities μ_j ← c_j Λ_j/Σ_i c_i Λ_i, and the mean of η over all modes.

    The factor c_j is the predicted probability of mode j. The factor Λ_j is the likelihood of the
    innovation of mode j, or one if y is NaN.
    """
    now, highest, total = modes.now, -np.inf, 0.0
    for j in range(len(now)):
        S, e = now[j]["spread"] + noise, y - modes.X[j, -1, 0]
        now[j]["logarithm"] = -0.5 * (np.log(S) + e**2 / S) if not np.isnan(y) else 0.0
        highest = max(highest, now[j]["logarithm"])
    for j in range(len(now)):
        share = now[j]["predicted"] * np.exp(now[j]["logarithm"] - highest)
        now[j]["probability"] = max(LEAST, share)
        total += now[j]["probability"]
    estimates[:] = 0.0
    for j in range(len(now)):
        now[j]["probability"] /= total
        for i in range(len(estimates)):
            estimates[i] += now[j]["probability"] * modes.theta[j, i]


@inlined
def mix(modes):
    """
    Compute the mixed estimate ξ⁰ and covariance P⁰ from which each mode continues.

    Mixing two modes at a time gives the same result as mixing all modes at once. A jump mode
    continues from a mixture of itself and the quiet mode. The quiet mode continues from a mixture
    of all modes. The probability Π_0j of a transition from the quiet mode 0 to a jump mode j is the
    same for all jump modes. A jump mode j can only persist or return to the quiet mode, so Π_j0 = 1
    − Π_jj.
    """
    now, count = modes.now, len(modes.now)
    quiet = now[0]
    total = quiet["stay"] * quiet["probability"]
    jump = (1.0 - quiet["stay"]) / (count - 1) * quiet["probability"]
    _join(modes, count, 0, 1.0)  # a copy of the quiet mode
    for j in range(1, count):
        weight = (1.0 - now[j]["stay"]) * now[j]["probability"]
        total += weight
        _join(modes, 0, j, weight / total)
        now[j]["predicted"] = jump + now[j]["stay"] * now[j]["probability"]
        _join(modes, j, count, jump / now[j]["predicted"])
    quiet["predicted"] = total


@inlined
def _join(modes, i, j, share):
    """Mix mode j into the estimate ξ and the covariance P of mode i, with the weight ``share``."""
    theta, X, apart = modes.theta, modes.X, modes.apart
    p = theta.shape[1]
    for a in range(p):
        apart[a] = theta[i, a] - theta[j, a]
        theta[i, a] -= share * apart[a]
    for a in range(len(apart) - p):
        apart[p + a] = X[i, a, 0] - X[j, a, 0]
        X[i, a, 0] -= share * apart[p + a]
    merge(share, modes.P[i], modes.P[j], apart)


@fused
def merge(share, P, other, apart):
    """
    Compute the covariance P ← (1−s) P + s P' + s (1−s) d dᵀ of a mixture of two modes.

    Parameters
    ----------
    share : float
        Weight s of the second mode in the mixture.
    P, other : (m, w) arrays
        Covariances P and P' of the two modes; the mixture covariance overwrites P.
    apart : (m,) array
        Difference d between the means of the two modes.
    """
    rest = 1.0 - share
    root = np.sqrt(share * rest)
    for a in range(len(apart)):
        for b in range(len(apart)):
            mine = rest * P[a, b] + share * other[a, b]
            P[a, b] = mine + (root * apart[a]) * (root * apart[b])


def read_mixture(state: Memory) -> tuple[Array, Array]:
    """Return the mean and the covariance of η over all modes, as arrays (p,) and (p, p)."""
    weights, theta = state["predicted"], state["theta"][:-1]  # both are values after mixing
    p, mean = theta.shape[1], weights @ theta
    apart = theta - mean
    covariance = np.einsum("j,jab->ab", weights, state["P"][:-1, :p, :p])
    return mean, covariance + np.einsum("j,ja,jb->ab", weights, apart, apart)
