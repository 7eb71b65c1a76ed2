"""The discretisation of a model: the order of its series, and the same by a matrix exponential."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.parametrization import Parametrization

Array = NDArray[np.float64]

TOLERANCE = 1e-12
LAW_TOLERANCE = 1e-9  # of the linear part of a step with laws; the error of the laws is 1e-5
LAW_RANGE = 2.0  # factor between θ and its start, for which that tolerance is planned
LAW_STEPS = 4  # of a sample, at least: resolves the time at which dry friction reverses
LAW_LONGEST = 1.25e-3  # s, as at 200 Hz: reversals are as fast at a lower sampling rate
LAW_STEP = 0.2  # times the time constant of the fastest mode, 1/|pole|: 1.3 ms on the paper's axis
MAX_SIZE = 3.0  # of A·T per substep; larger terms cancel and cost digits, e^3 = 20
MAX_ORDER = 40  # rows of `flexaxis.estimators.models.series.SERIES`
MAX_STEPS = 10_000  # of a sample: a mode of 30 000 radians a sample cannot be observed


def plan(
    model: Parametrization,
    lower: Array,
    upper: Array,
    period: float,
    *,
    steps: int | None = None,
) -> tuple[int, int, int]:
    """
    Return the steps of a sample, and order and substeps of each with a negligible remainder.

    |A(θ)| is bounded entry by entry over the box, each monomial at its worst corner. The Perron
    root ρ of that nonnegative matrix is the least norm that any choice of units can give it, so
    x = ρT/s is the size of a substep whatever the units, and the remainder of the series after m
    terms is below Σ_{k>m} k·x^(k−1)/k! = Σ_{k≥m} x^k/k! for the sensitivities, which is the most.
    Chains of integrators, which units can make as small as one likes, end after 2(n+1) terms.

    A model with laws has a less accurate series, as its laws are solved less accurately. It is
    planned for θ within `LAW_RANGE` of its start; beyond that it still converges.

    Parameters
    ----------
    model : Parametrization
    lower, upper : (p,) arrays
        The box, without zero in it.
    period : float
        Sampling period [s].
    steps : int, optional
        Steps of a sample of a model with laws; `law_steps` by default.

    Raises
    ------
    EstimatorError
        If a sample would need more than `MAX_STEPS` substeps.
    """
    least, tolerance = min(2 * (model.n + 1), MAX_ORDER), TOLERANCE
    if model.forces:
        least, tolerance, steps = 0, LAW_TOLERANCE, steps or law_steps(model, period)
        ends = np.sort([model.theta / LAW_RANGE, model.theta * LAW_RANGE], axis=0)
        lower, upper = np.maximum(lower, ends[0]), np.minimum(upper, ends[1])
    steps = steps or 1
    size = _perron_root(model, lower, upper) * period / steps
    parts = max(1.0, size / MAX_SIZE)
    if not parts * steps <= MAX_STEPS:
        raise EstimatorError(
            f"the model is too fast for a sampling period of {period:g} s: a sample would take "
            f"{parts * steps:.3g} steps, and {MAX_STEPS} are the most. Correct the entry of A that "
            "is so large, leave out the state that is so fast, or narrow the bounds"
        )
    substeps = math.ceil(parts)
    return steps, max(least, _order(size / substeps, tolerance)), substeps


def law_steps(model: Parametrization, period: float) -> int:
    """Return the number of steps in which the laws of a model are solved in a sample."""
    A, _, _ = model.matrices(model.theta)
    fastest = float(max(abs(np.linalg.eigvals(A))))
    longest = math.ceil(period / LAW_LONGEST - 1e-9)  # not one more for a rounded period
    return max(LAW_STEPS, longest, math.ceil(fastest * period / LAW_STEP))


def _order(x: float, tolerance: float) -> int:
    """Return the least order whose remainder is below a tolerance for a substep of size x."""
    powers = np.cumprod(np.r_[1.0, x / np.arange(1.0, 60.0)])  # x^k/k!
    remainders = np.cumsum(powers[::-1])[::-1]
    return int(np.argmax(remainders <= tolerance))


def _perron_root(model: Parametrization, lower: Array, upper: Array) -> float:
    """Return the largest eigenvalue of the entrywise bound of |A| over the box [1/s]."""
    exponent = model.exponent.astype(float)
    ends = np.abs([lower, upper])
    corner = np.where(exponent > 0, ends.max(axis=0), ends.min(axis=0))
    bound = np.zeros((model.n + 1, model.n + 1))
    values = abs(model.coefficient) * np.prod(corner**exponent, axis=1)
    np.add.at(bound, (model.row, model.column), values)
    return float(max(abs(np.linalg.eigvals(bound[:-1, :-1]))))


def extended_system(model: Parametrization, theta: Array) -> tuple[Array, Array, Array]:
    """
    Return the extended system of eq. (22), (23), one block z_i for each parameter.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array

    Returns
    -------
    F : ((p+1)n, (p+1)n) array
        Ẋ = F X + G u for X = [z_1; …; z_p; x].
    G : ((p+1)n, 1) array
    H : (p+1, (p+1)n) array
        [ψ; ŷ] = H X.
    """
    block, (p, n) = model.blocks(theta), (len(theta), model.n)
    F, H = np.zeros(((p + 1) * n, (p + 1) * n)), np.zeros((p + 1, (p + 1) * n))
    for i, derivative in enumerate(np.roll(block, -1, axis=0)):  # the model itself comes last
        rows = slice(i * n, (i + 1) * n)
        F[rows, rows], H[i, rows] = block[0, :n, :n], block[0, n, :n]
        F[rows, -n:], H[i, -n:] = derivative[:n, :n], derivative[n, :n]
    G = np.roll(block, -1, axis=0)[:, :n, n:].reshape(-1, 1)
    return F, G, H


def discretize(F: Array, G: Array, period: float) -> tuple[Array, Array]:
    """Return Φ, Γ of X[k+1] = Φ X[k] + Γ u[k], the input held over the sample."""
    from scipy.linalg import expm  # takes a tenth of a second to import

    N = len(F)
    held = np.zeros((N + 1, N + 1))  # the input is one more state, which does not change
    held[:N, :N], held[:N, N:] = F, G
    exponential = expm(held * period)
    return exponential[:N, :N], exponential[:N, N:]


def sampled_system(
    model: Parametrization, theta: ArrayLike, period: float
) -> tuple[Array, Array, Array]:
    """
    Return the extended system (22), (23) for a torque held over each sample.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array_like
        Identified parameters.
    period : float
        Sampling period T [s].

    Returns
    -------
    transition : ((p+1)n, (p+1)n) array
        Φ in X[k+1] = Φ X[k] + Γ u[k].
    gain : ((p+1)n,) array
        Γ.
    output : (p+1, (p+1)n) array
        H in [ψ; ŷ] = H X.
    """
    F, G, H = extended_system(model, np.asarray(theta, float))
    transition, gain = discretize(F, G, period)
    # a state that starts every sample at zero has no influence on the next
    transition.reshape(len(F), -1, model.n)[:, :, list(model.reset)] = 0.0
    return np.ascontiguousarray(transition), gain[:, 0].copy(), H
