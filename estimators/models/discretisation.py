"""Discretisation of a model by a truncated power series or by a matrix exponential."""

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
LAW_LONGEST = 1.25e-3  # s, longest step, as with LAW_STEPS at 200 Hz: at lower sampling rates,
# friction reversals are as fast
LAW_STEP = 0.2  # longest step relative to 1/|pole| of the fastest mode: 1.3 ms on the paper's axis
MAX_SIZE = 3.0  # largest norm of A·T in a substep; larger terms cancel and lose digits (e^3 = 20)
MAX_ORDER = 40  # largest order: the number of rows of `flexaxis.estimators.models.series.SERIES`
MAX_STEPS = 10_000  # largest number of substeps per sample: a faster mode, of 30 000 radians per
# sample, cannot be observed


def plan(
    model: Parametrization,
    lower: Array,
    upper: Array,
    period: float,
    *,
    steps: int | None = None,
) -> tuple[int, int, int]:
    """
    Return the number of steps per sample, the series order, and the number of substeps per step.

    The truncation error of the series is negligible for all parameters θ within their bounds. The
    function bounds each entry of |A(θ)| by evaluating every monomial at the worst combination of
    parameter bounds. These bounds form a nonnegative matrix. The Perron root ρ of this matrix is
    the smallest matrix norm that any choice of units can achieve. With s substeps per sample, the
    normalised substep length x = ρT/s therefore does not depend on the units. The sensitivities
    have the largest truncation error. After m terms, this error is below Σ_{k>m} k·x^(k−1)/k! =
    Σ_{k≥m} x^k/k!. For a chain of n integrators, a suitable choice of units makes the matrix norm
    arbitrarily small, but the series is exact only after 2(n+1) terms. For a linear model, the
    order is therefore at least 2(n+1), but at most `MAX_ORDER`.

    For a model with nonlinear torques, the tolerance of the series is larger, because the solution
    for the nonlinear torques is less accurate anyway. The accuracy of the series is guaranteed if
    each parameter is within a factor of `LAW_RANGE` of its initial value. If a parameter differs
    from its initial value by a larger factor, the series still converges, but without a guaranteed
    accuracy.

    Parameters
    ----------
    model : Parametrization
    lower, upper : (p,) arrays
        Lower and upper bounds of the parameters, which must not enclose zero.
    period : float
        Sampling period [s].
    steps : int, optional
        Number of steps per sample for a model with torque laws; by default, the result of
        `law_steps`.

    Returns
    -------
    steps, order, parts : int
        Number of steps per sample, order of the power series, and number of substeps per step.

    Raises
    ------
    EstimatorError
        If the integration of one sample requires more than `MAX_STEPS` substeps.
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
            f"the fastest mode of the model is too fast for a sampling period of {period:g} s: the "
            f"integration would need {parts * steps:.3g} steps per sample, but at most {MAX_STEPS} "
            "are allowed. Reduce the largest entry of A, remove the fastest state, or narrow the "
            "parameter bounds"
        )
    substeps = math.ceil(parts)
    return steps, max(least, _order(size / substeps, tolerance)), substeps


def law_steps(model: Parametrization, period: float) -> int:
    """Return the number of integration steps per sample for a model with nonlinear torques."""
    A, _, _ = model.matrices(model.theta)
    fastest = float(max(abs(np.linalg.eigvals(A))))
    longest = math.ceil(period / LAW_LONGEST - 1e-9)  # 1e-9 allows for rounding of the period
    return max(LAW_STEPS, longest, math.ceil(fastest * period / LAW_STEP))


def _order(x: float, tolerance: float) -> int:
    """Return the lowest series order whose error at substep length x is at most ``tolerance``."""
    powers = np.cumprod(np.r_[1.0, x / np.arange(1.0, 60.0)])  # x^k/k!
    remainders = np.cumsum(powers[::-1])[::-1]
    return int(np.argmax(remainders <= tolerance))


def _perron_root(model: Parametrization, lower: Array, upper: Array) -> float:
    """Return the Perron root [1/s] of the matrix that bounds |A(θ)| for all allowed θ."""
    exponent = model.exponent.astype(float)
    ends = np.abs([lower, upper])
    corner = np.where(exponent > 0, ends.max(axis=0), ends.min(axis=0))
    bound = np.zeros((model.n + 1, model.n + 1))
    values = abs(model.coefficient) * np.prod(corner**exponent, axis=1)
    np.add.at(bound, (model.row, model.column), values)
    return float(max(abs(np.linalg.eigvals(bound[:-1, :-1]))))


def extended_system(model: Parametrization, theta: Array) -> tuple[Array, Array, Array]:
    """
    Return the extended system of equations (22) and (23), with the sensitivities z_i to each θ_i.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array
        Identified parameters.

    Returns
    -------
    F : ((p+1)n, (p+1)n) array
        System matrix F in Ẋ = F X + G u with X = [z_1; …; z_p; x].
    G : ((p+1)n, 1) array
        Input matrix G in the equation Ẋ = F X + G u.
    H : (p+1, (p+1)n) array
        Output matrix H in [ψ; ŷ] = H X.
    """
    blocks, p, n = model.blocks(theta), len(theta), model.n
    whole = np.multiply.outer(np.eye(p + 1), blocks[0]).swapaxes(1, 2)
    whole[:, :, p] = np.roll(blocks, -1, axis=0)  # the block of the model itself comes last
    N = (p + 1) * n
    F, H = whole[:, :n, :, :n].reshape(N, N), whole[:, n, :, :n].reshape(p + 1, N)
    return F, whole[:, :n, p, n].reshape(N, 1), H


def discretize(F: Array, G: Array, period: float) -> tuple[Array, Array]:
    """Return Φ and Γ in X[k+1] = Φ X[k] + Γ u[k] for an input that is constant between samples."""
    from scipy.linalg import expm  # takes a tenth of a second to import

    held = np.pad(np.hstack([F, G]), ((0, 1), (0, 0)))  # the input is treated as a constant state
    exponential = expm(held * period)[:-1]
    return exponential[:, :-1], exponential[:, -1:]


def sampled_system(
    model: Parametrization, theta: ArrayLike, period: float
) -> tuple[Array, Array, Array]:
    """
    Return the extended system of equations (22) and (23), sampled for a piecewise constant torque.

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
        State transition matrix Φ in X[k+1] = Φ X[k] + Γ u[k].
    gain : ((p+1)n,) array
        Input vector Γ in X[k+1] = Φ X[k] + Γ u[k].
    output : (p+1, (p+1)n) array
        Output matrix H in [ψ; ŷ] = H X of the sampled system.
    """
    F, G, H = extended_system(model, np.asarray(theta, float))
    transition, gain = discretize(F, G, period)
    # a state that is reset to zero at the start of every sample does not affect the next sample
    transition.reshape(len(F), -1, model.n)[:, :, list(model.reset)] = 0.0
    return np.ascontiguousarray(transition), gain[:, 0].copy(), H
