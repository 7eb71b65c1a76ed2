"""Choose order and substeps of the Taylor series from the box that the parameters stay in."""

import math

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.parametrization import Parametrization

TOLERANCE = 1e-12
LAW_TOLERANCE = 1e-9  # of the linear part of a step with laws, whose own error is 1e-5
LAW_RANGE = 2.0  # factor by which θ is off its start, for which that tolerance is planned
LAW_STEPS = 4  # of a sample at least: so well is a reversal of dry friction met in time
LAW_LONGEST = 1.25e-3  # s, as at 200 Hz: a motion reverses as fast, however seldom it is sampled
LAW_STEP = 0.2  # of the fastest mode's time constant, |pole|⁻¹: 1.3 ms on the paper's axis
MAX_SIZE = 3.0  # of A·T per substep; larger terms cancel and cost digits, e^3 = 20
MAX_ORDER = 40


def plan(
    model: Parametrization, lower: NDArray[np.float64], upper: NDArray[np.float64], period: float
) -> tuple[int, int]:
    """
    Return the order m and the substeps s of least work m·s with a negligible remainder.

    |A(θ)| is bounded entry by entry over the box, each monomial at its worst corner. The Perron
    root ρ of that nonnegative matrix is the least norm that any choice of units can give it, so
    x = ρT/s is the size of a substep whatever the units, and the remainder of the series after m
    terms is below Σ_{k>m} k·x^(k−1)/k! = Σ_{k≥m} x^k/k! for the sensitivities, which is the most.
    Chains of integrators, which units can make as small as one likes, end after 2(n+1) terms.

    Parameters
    ----------
    model : Parametrization
    lower, upper : (p,) arrays
        The box, without zero in it.
    period : float
        Sampling period [s].

    Returns
    -------
    order, substeps : int
        The order is at most `MAX_ORDER`.
    """
    size = _perron_root(model, lower, upper) * period
    fewest = max(1, math.ceil(size / MAX_SIZE))
    least = min(2 * (model.n + 1), MAX_ORDER)
    choices = [(max(least, _order(size / s)), s) for s in range(fewest, 4 * fewest + 1)]
    return min(choices, key=math.prod)


def law_plan(
    model: Parametrization, lower: NDArray[np.float64], upper: NDArray[np.float64], period: float
) -> tuple[int, int, int]:
    """
    Return steps in a sample for a model with laws, and order and substeps of each.

    Parameters
    ----------
    model, lower, upper, period
        As for `plan`.
    """
    A, _, _ = model.matrices(model.theta)
    fastest = float(max(abs(np.linalg.eigvals(A))))
    longest = math.ceil(period / LAW_LONGEST - 1e-9)  # not one more for a rounded period
    steps = max(LAW_STEPS, longest, math.ceil(fastest * period / LAW_STEP))
    # wherever θ may go the series converges, if not to the last digit, which the laws lack anyway
    ends = np.sort([model.theta / LAW_RANGE, model.theta * LAW_RANGE], axis=0)
    size = _perron_root(model, np.maximum(lower, ends[0]), np.minimum(upper, ends[1]))
    size *= period / steps
    substeps = max(1, math.ceil(size / MAX_SIZE))
    return steps, _order(size / substeps, LAW_TOLERANCE), substeps


def _order(x: float, tolerance: float = TOLERANCE) -> int:
    """Return the least order whose remainder is below a tolerance for a substep of size x."""
    powers = np.cumprod(np.r_[1.0, x / np.arange(1.0, 60.0)])  # x^k/k!
    remainders = np.cumsum(powers[::-1])[::-1]
    return int(np.argmax(remainders <= tolerance))


def _perron_root(
    model: Parametrization, lower: NDArray[np.float64], upper: NDArray[np.float64]
) -> float:
    """Return the largest eigenvalue of the entrywise bound of |A| over the box [1/s]."""
    corner = np.where(model.exponent > 0, np.maximum(abs(lower), abs(upper)), 0.0)
    corner = np.where(model.exponent < 0, np.minimum(abs(lower), abs(upper)), corner)
    corner = np.where(model.exponent == 0, 1.0, corner)
    bound = np.zeros((model.n + 1, model.n + 1))
    values = abs(model.coefficient) * np.prod(corner ** model.exponent.astype(float), axis=1)
    np.add.at(bound, (model.row, model.column), values)
    return float(max(abs(np.linalg.eigvals(bound[:-1, :-1]))))
