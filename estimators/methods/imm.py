"""The interacting-multiple-model filter, which consists of several interacting Kalman filters."""

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
    Return an interacting-multiple-model filter with one quiet mode and a jump mode for each θ_i.

    Every mode j is a joint extended Kalman filter (`flexaxis.estimators.methods.ekf`). The quiet
    mode assumes that the covariance of θ increases by W in every sample. Jump mode i also increases
    the variance of θ_i by ``jump[i]`` in every sample. The sequence of modes is a Markov chain with
    the transition matrix Π. Let μ be the mode probabilities, and let Λ_j be the Gaussian likelihood
    of the innovation in mode j. The following equations update the modes by one sample:

        μ_j ← c_j Λ_j / Σ,  c_j = Σ_i Π_ij μ_i,  μ_i|j = Π_ij μ_i/c_j,
        ξ⁰_j = Σ_i μ_i|j ξ_i,  P⁰_j = Σ_i μ_i|j [P_i + (ξ_i−ξ⁰_j)(ξ_i−ξ⁰_j)ᵀ],

    Mode j then continues from the mixed estimate ξ⁰_j and the mixed covariance P⁰_j. The filter
    returns the estimate, the covariance and the innovation of the mixture of all modes. All modes
    share the estimated noise variance R. The algorithm is described in *The interacting multiple
    model algorithm for systems with Markovian switching coefficients* (Blom and Bar-Shalom, 1988).

    Parameters
    ----------
    design : Design
        Filter design, as for `flexaxis.estimators.methods.ekf.joint_ekf`. The drift covariance W of
        the design applies to the quiet mode.
    jump : (p,) array_like
        For each parameter θ_i, the variance that jump mode i adds in every sample.
    rate : float
        Total mean rate of jumps, summed over all parameters [1/s].
    hold : float
        Mean time for which a jump mode remains active [s].
    **torque_noise : float
        Torque noise settings, as for `flexaxis.estimators.methods.ekf.joint_ekf`.

    Raises
    ------
    EstimatorError
        If an option is invalid.
    """
    period, p = design.period, len(design.theta0)
    if not (0 < rate * period < 1 and period < hold < np.inf):
        raise EstimatorError(
            f"rate is {rate} 1/s and hold is {hold} s, but for a sampling period of {period} s, "
            f"rate must lie between 0 and {1 / period:g} 1/s, and hold must exceed the period"
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
    Return the interacting-multiple-model filter for an estimation problem.

    Parameters
    ----------
    walk : float, optional
        Standard deviation of each parameter's random walk after one second in the quiet mode,
        relative to θ(0). The default of ``walk`` is the tuned value for the axis, or 0.0015 if
        there is no tuned value.
    spread : float
        Standard deviation of the initial parameter error, relative to θ(0).
    jump : float, optional
        Standard deviation of a parameter jump, relative to θ(0). The default of ``jump`` is 0.3 for
        an axis with a tuned value of ``walk``, and 0.1581 for any other axis.
    rate : float, optional
        Total mean rate of jumps, summed over all parameters [1/s]. The default of ``rate`` is 1e-6
        for an axis with a tuned value of ``walk``, and 1e-3 for any other axis.
    hold : float
        Mean duration of a parameter jump [s].
    """
    tuned = problem.tuned("imm") is not None
    rate = (TUNED_RATE if tuned else RATE) if rate is None else rate
    jump = (TUNED_JUMP if tuned else JUMP) if jump is None else jump
    design = problem.walk_design("imm", WALK, walk=walk, spread=spread)
    above_zero("rate", rate, "the mean rate of parameter jumps [1/s]")
    above_zero("jump", jump, "the standard deviation of parameter jumps")
    above_zero("hold", hold, "the mean duration of a parameter jump [s]")
    variance = problem.period / hold * (jump * problem.theta) ** 2
    return joint_imm(
        design, jump=variance, rate=rate, hold=hold, **problem.torque_noise(problem.model)
    )


ENTRIES = (
    Entry(
        "imm",
        "interacting Kalman filters: one without jumps, and one for jumps of each parameter",
        _imm,
        knob="walk",
        default=WALK,
        rank=9,
    ),
)
