"""The joint extended Kalman filter for the state and the parameters."""

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

    The model is θ[k+1] = θ[k] + w, cov w = W; x[k+1] = f(x[k], θ[k], u[k]), exact for a held u;
    y = h(x) + e, var e = σ². If y is an angle, noise also acts on the state that the torque drives;
    see `flexaxis.estimators.filters.noise`. This is the textbook filter of L. Ljung, *Asymptotic
    behavior of the extended Kalman filter as a parameter estimator for linear systems*, IEEE Trans.
    AC 24 (1979). Unlike the prediction-error method, the filter also corrects the state. The
    variance of θ_i is limited to θ_i(0)² by scaling a row and a column of P. The filter skips an
    isolated outlier beyond 100 standard deviations. If further innovations exceed this limit, they
    are clipped to the limit.

    P is the covariance of the error if θ is a random walk with the covariance W. If θ is constant
    and adaptation is slow, the error has half this variance. After a jump of θ, P is far too small.

    Parameters
    ----------
    design : Design
        Options of the filter. The drift of the design is W, the covariance that θ gains in every
        sample. If the design does not specify the noise, R = σ² is learnt from the innovations.
    **torque_noise
        Result of `flexaxis.estimators.problem.Problem.torque_noise`.
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
    Return the joint extended Kalman filter for a problem.

    Parameters
    ----------
    walk : float, optional
        Standard deviation of the random walk of every θ after one second, relative to θ(0). The
        default is 0.008 if y is an angle; otherwise it is the tuned value for this axis, or 0.002.
    spread : float
        Standard deviation of the initial error of θ, relative to θ(0).
    """
    if problem.output == "angle" and walk is None:
        walk = COUNTED
    design = problem.walk_design("ekf", WALK, walk=walk, spread=spread)
    return joint_ekf(design, **problem.torque_noise(problem.model))


ENTRIES = (
    Entry(
        "ekf",
        "a joint extended Kalman filter for the state and the parameters",
        _extended,
        knob="walk",
        default=WALK,
        rank=7,
    ),
)
