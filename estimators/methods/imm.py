"""The interacting-multiple-model filter: extended Kalman filters that exchange their estimates."""

import numpy as np
from numpy.typing import ArrayLike

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.filters.design import Design, above_zero, finite_vector
from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.interacting_models import modes_of, read_mixture
from flexaxis.estimators.filters.joint import joint_arrays
from flexaxis.estimators.methods import loops
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry

WALK, RATE, JUMP = 0.0015, 1e-3, 0.1581  # 1/√s, 1/s and relative to θ(0), without a tuned walk
TUNED_RATE, TUNED_JUMP = 1e-6, 0.3  # the same with a tuned walk. With a rate of one jump in 1000 s,
# the noise would exceed that of the paper's method for every walk


def joint_imm(
    design: Design,
    *,
    jump: ArrayLike,
    rate: float = 1e-3,
    hold: float = 0.05,
    **torque_noise: float,
) -> CompiledFilter:
    """
    Return an interacting-multiple-model filter with a quiet mode and one jump mode for each θ_i.

    Every mode j is a joint extended Kalman filter (`flexaxis.estimators.methods.ekf`). The quiet
    mode uses the covariance W; jump mode i uses W with an additional variance for θ_i. The sequence
    of modes is a Markov chain with the transition matrix Π. With the probabilities μ and Gaussian
    likelihoods Λ_j of the innovations, every sample is processed by

        μ_j ← c_j Λ_j / Σ,  c_j = Σ_i Π_ij μ_i,  μ_i|j = Π_ij μ_i/c_j,
        ξ⁰_j = Σ_i μ_i|j ξ_i,  P⁰_j = Σ_i μ_i|j [P_i + (ξ_i−ξ⁰_j)(ξ_i−ξ⁰_j)ᵀ],

    and mode j continues from ξ⁰_j, P⁰_j. The filter returns the estimate, the covariance and the
    innovation of the mixture. One value of R is learnt for all modes. H. A. P. Blom and
    Y. Bar-Shalom, *The interacting multiple model algorithm for systems with Markovian switching
    coefficients*, IEEE Trans. AC 33 (1988) 780–783.

    Parameters
    ----------
    design : Design
        Options as in `flexaxis.estimators.methods.ekf.joint_ekf`. The drift applies to the quiet
        mode.
    jump : (p,) array_like
        Variance that each θ_i gains in every sample during a jump of this parameter.
    rate : float
        Mean rate of jumps of any parameter [1/s].
    hold : float
        Mean duration of a jump mode [s].
    **torque_noise
        Options as in `flexaxis.estimators.methods.ekf.joint_ekf`.

    Raises
    ------
    EstimatorError
        If an option is invalid.
    """
    period, p = design.period, len(design.theta0)
    if not (0 < rate * period < 1 and period < hold < np.inf):
        raise EstimatorError(
            f"rate is {rate} and hold is {hold}; with a period of {period} s the rate must lie "
            f"between 0 and {1 / period:g} 1/s, and hold must exceed the period"
        )
    variances = finite_vector("jump", jump, p) / design.scale**2
    start = modes_of(
        joint_arrays(design, rests=False, stay=1 - period / hold, **torque_noise), 1 + p
    )
    start["stay"][0] = 1 - rate * period
    which = np.arange(p)
    start["drift"][1 + which, which, which] += variances
    start["probability"][0] = start["predicted"][0] = 1.0
    return CompiledFilter(loops.imm, start, design, read_mixture)


def _imm(
    problem: Problem,
    *,
    walk: float | None = None,
    spread: float = 0.2,
    jump: float | None = None,
    rate: float | None = None,
    hold: float = 0.05,
) -> CompiledFilter:
    """
    Return the interacting-multiple-model filter for a problem.

    Parameters
    ----------
    walk, spread
        Options as in `flexaxis.estimators.methods.ekf._extended`. The walk applies to the quiet
        mode. Its default is 0.0015 on an axis without a tuned value.
    jump : float, optional
        Standard deviation of a jump of θ_i, relative to θ(0); 0.3 on an axis with a tuned walk,
        otherwise 0.1581.
    rate : float, optional
        Mean rate of jumps [1/s]; 1e-6 on an axis with a tuned walk, otherwise 1e-3.
    hold : float
        Mean duration of a jump [s].
    """
    tuned = problem.tuned("imm") is not None
    rate = (TUNED_RATE if tuned else RATE) if rate is None else rate
    jump = (TUNED_JUMP if tuned else JUMP) if jump is None else jump
    design = problem.walk_design("imm", WALK, walk=walk, spread=spread)
    above_zero("rate", rate, "the mean rate of jumps in 1/s")
    above_zero("jump", jump, "the standard deviation of a jump, relative to θ(0)")
    above_zero("hold", hold, "the mean duration of a jump in seconds")
    variance = problem.period / hold * (jump * problem.theta) ** 2
    return joint_imm(
        design, jump=variance, rate=rate, hold=hold, **problem.torque_noise(problem.model)
    )


ENTRIES = (
    Entry(
        "imm",
        "interacting multiple models: a Kalman filter without jumps, and one for each parameter",
        _imm,
        knob="walk",
        default=WALK,
        rank=9,
    ),
)
