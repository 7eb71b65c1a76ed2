"""Discretisation of a model: the order of the series in `series`, and a matrix exponential."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.parametrization import Parametrization

Array = NDArray[np.float64]

TOLERANCE = 1e-12  # largest remainder of the series of a model without laws
LAW_TOLERANCE = 1e-9  # the same for the linear part of a model with laws; laws have errors of 1e-5
LAW_RANGE = 2.0  # largest ratio between θ and its initial value for which LAW_TOLERANCE is
# guaranteed
LAW_STEPS = 4  # smallest number of steps per sample, which resolves the time of a friction reversal
LAW_LONGEST = 1.25e-3  # s, longest step, as at 200 Hz: friction reversals are as fast at lower
# rates
LAW_STEP = 0.2  # longest step relative to 1/|pole| of the fastest mode: 1.3 ms on the paper's axis
MAX_SIZE = 3.0  # largest norm of A·T in a substep; larger terms cancel and lose digits (e^3 = 20)
MAX_ORDER = 40  # largest order: the number of rows of `flexaxis.estimators.models.series.SERIES`
MAX_STEPS = 10_000  # largest number per sample: a mode of 30 000 radians per sample cannot be
# observed


def plan(
    model: Parametrization,
    lower: Array,
    upper: Array,
    period: float,
    *,
    steps: int | None = None,
) -> tuple[int, int, int]:
    """
    Return the steps per sample, the order of the series, and the substeps per step.

    The remainder of the series is negligible for any θ in the box. Each entry of |A(θ)| is bounded
    over the box, with every monomial evaluated at its worst corner. The Perron root ρ of this
    nonnegative matrix of bounds is the smallest norm that any choice of units can achieve.
    Therefore the size x = ρT/s of a substep does not depend on the units. The sensitivities have
    the largest remainder. After m terms, this remainder is below
    Σ_{k>m} k·x^(k−1)/k! = Σ_{k≥m} x^k/k!. A choice of units can make chains of integrators
    arbitrarily small, but their series ends after 2(n+1) terms.

    The series of a model with laws has a larger tolerance, because the solution of the laws is less
    accurate as well. The accuracy of the series is guaranteed for θ within a factor of `LAW_RANGE`
    of the initial value. Outside this range, the series still converges.

    Parameters
    ----------
    model : Parametrization
    lower, upper : (p,) arrays
        Lower and upper bounds of the parameters; the box must not contain zero.
    period : float
        Sampling period [s].
    steps : int, optional
        Number of steps per sample for a model with laws; computed by `law_steps` by default.

    Returns
    -------
    steps, order, parts : int
        Number of steps per sample, order of the series, and number of substeps per step.

    Raises
    ------
    EstimatorError
        If a sample requires more than `MAX_STEPS` substeps.
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
            f"{parts * steps:.3g} steps, but at most {MAX_STEPS} are allowed. Correct the largest "
            "entry of A, remove the fastest state, or narrow the bounds"
        )
    substeps = math.ceil(parts)
    return steps, max(least, _order(size / substeps, tolerance)), substeps


def law_steps(model: Parametrization, period: float) -> int:
    """Return the number of steps per sample in which the laws of a model are solved."""
    A, _, _ = model.matrices(model.theta)
    fastest = float(max(abs(np.linalg.eigvals(A))))
    longest = math.ceil(period / LAW_LONGEST - 1e-9)  # 1e-9 allows for rounding of the period
    return max(LAW_STEPS, longest, math.ceil(fastest * period / LAW_STEP))


def _order(x: float, tolerance: float) -> int:
    """Return the lowest order with a remainder below a tolerance for a substep of size x."""
    powers = np.cumprod(np.r_[1.0, x / np.arange(1.0, 60.0)])  # x^k/k!
    remainders = np.cumsum(powers[::-1])[::-1]
    return int(np.argmax(remainders <= tolerance))


def _perron_root(model: Parametrization, lower: Array, upper: Array) -> float:
    """Return the largest eigenvalue [1/s] of the matrix of bounds of |A(θ)| over the box."""
    exponent = model.exponent.astype(float)
    ends = np.abs([lower, upper])
    corner = np.where(exponent > 0, ends.max(axis=0), ends.min(axis=0))
    bound = np.zeros((model.n + 1, model.n + 1))
    values = abs(model.coefficient) * np.prod(corner**exponent, axis=1)
    np.add.at(bound, (model.row, model.column), values)
    return float(max(abs(np.linalg.eigvals(bound[:-1, :-1]))))


def extended_system(model: Parametrization, theta: Array) -> tuple[Array, Array, Array]:
    """
    Return the extended system of eq. (22), (23) with one block z_i for each parameter.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array
        Identified parameters.

    Returns
    -------
    F : ((p+1)n, (p+1)n) array
        System matrix of Ẋ = F X + G u for X = [z_1; …; z_p; x].
    G : ((p+1)n, 1) array
        Input matrix.
    H : (p+1, (p+1)n) array
        Output matrix of [ψ; ŷ] = H X.
    """
    blocks, p, n = model.blocks(theta), len(theta), model.n
    whole = np.multiply.outer(np.eye(p + 1), blocks[0]).swapaxes(1, 2)
    whole[:, :, p] = np.roll(blocks, -1, axis=0)  # the block of the model itself comes last
    N = (p + 1) * n
    F, H = whole[:, :n, :, :n].reshape(N, N), whole[:, n, :, :n].reshape(p + 1, N)
    return F, whole[:, :n, p, n].reshape(N, 1), H


def discretize(F: Array, G: Array, period: float) -> tuple[Array, Array]:
    """Return Φ and Γ of X[k+1] = Φ X[k] + Γ u[k] for an input that is held over each sample."""
    from scipy.linalg import expm  # takes a tenth of a second to import

    held = np.pad(np.hstack([F, G]), ((0, 1), (0, 0)))  # the input is treated as a constant state
    exponential = expm(held * period)[:-1]
    return exponential[:, :-1], exponential[:, -1:]


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
        Matrix Φ in X[k+1] = Φ X[k] + Γ u[k].
    gain : ((p+1)n,) array
        Vector Γ.
    output : (p+1, (p+1)n) array
        Matrix H in [ψ; ŷ] = H X.
    """
    F, G, H = extended_system(model, np.asarray(theta, float))
    transition, gain = discretize(F, G, period)
    # a state that is reset to zero at the start of every sample does not affect the next sample
    transition.reshape(len(F), -1, model.n)[:, :, list(model.reset)] = 0.0
    return np.ascontiguousarray(transition), gain[:, 0].copy(), H
