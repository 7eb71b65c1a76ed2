"""The extended Kalman filter that jointly estimates the state and the parameters."""

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.filters.fault_monitor import HEEDS_NOTHING
from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.joint import joint_arrays, read_joint
from flexaxis.estimators.methods import loops
from flexaxis.estimators.models.memory import Memory
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry

WALK = 0.002  # 1/√s, random walk of θ/θ(0) on an axis without a tuned value
COUNTED = 0.008  # 1/√s, the same if y is an angle. The torque noise makes the filter slower. With
# this value, the noise of f_m on encoder_fm_step equals that of a filter of increments (seeds 0-5)


def joint_ekf(design: Design, **torque_noise: float) -> CompiledFilter:
    """
    Return an extended Kalman filter for ξ = [θ; x], where θ is a random walk.

    The parameter model is θ[k+1] = θ[k] + w, where w has the covariance W. The state model is
    x[k+1] = f(x[k], θ[k], u[k]), which is exact if the torque u is constant between samples. The
    measurement model is y = h(x) + e, where e has the variance σ². If y is an angle, torque noise
    also acts on the state that the torque drives (`flexaxis.estimators.filters.noise`). The filter
    is the standard joint filter, which is analysed in *Asymptotic behavior of the extended Kalman
    filter as a parameter estimator for linear systems* (Ljung, 1979). Unlike the prediction-error
    method, the Kalman filter also corrects the state with each measurement. The filter limits the
    variance of each θ_i to θ_i(0)² by scaling the corresponding row and column of P. The filter
    skips samples with innovations of more than 100 standard deviations, but at most two such
    samples in succession.

    P is the covariance of the estimation error if θ is a random walk with the covariance W. If θ is
    constant and adaptation is slow, the actual error covariance is half of P. After a jump of θ,
    the claimed covariance P is far smaller than the actual error covariance.

    Parameters
    ----------
    design : Design
        Options of the filter. The field ``drift`` of the design is W, the covariance of the random
        walk in one sample. If the design does not specify the noise, the filter estimates R = σ²
        from the innovations.
    **torque_noise : float
        Torque noise settings, as returned by `flexaxis.estimators.problem.Problem.torque_noise`.
    """
    start = Memory(joint_arrays(design, rests=False, heeds=HEEDS_NOTHING, **torque_noise))
    return CompiledFilter(loops.ekf, start, design, read_joint)


def _extended(
    problem: Problem,
    *,
    walk: float | None = None,
    spread: float = 0.2,
) -> CompiledFilter:
    """
    Return the joint extended Kalman filter for an estimation problem.

    Parameters
    ----------
    walk : float, optional
        Standard deviation of each parameter's random walk after one second, relative to θ(0). If y
        is an angle, ``walk`` is 0.008 by default. For any other output, the default of ``walk`` is
        the tuned value for the axis, or 0.002 if there is no tuned value.
    spread : float
        Standard deviation of the initial parameter error, relative to θ(0).
    """
    if problem.output == "angle" and walk is None:
        walk = COUNTED
    design = problem.walk_design("ekf", WALK, walk=walk, spread=spread)
    return joint_ekf(design, **problem.torque_noise(problem.model))


ENTRIES = (
    Entry(
        "ekf",
        "an extended Kalman filter that jointly estimates the state and the parameters",
        _extended,
        knob="walk",
        default=WALK,
        rank=7,
    ),
)
