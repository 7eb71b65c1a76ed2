"""Joint extended Kalman filter for state and parameters."""

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.filters.fault_monitor import HEEDS_NOTHING
from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.joint import joint_arrays, read_joint
from flexaxis.estimators.models.memory import Memory
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry

WALK = 0.002  # 1/√s, of θ/θ(0), where no tuning is known


def joint_ekf(design: Design) -> CompiledFilter:
    """
    Make an extended Kalman filter for ξ = [θ; x], with θ a random walk and no noise on x.

    θ[k+1] = θ[k] + w, cov w = W; x[k+1] = f(x[k], θ[k], u[k]), exact for a held u; y = h(x) + e,
    var e = σ². The textbook filter of L. Ljung, *Asymptotic behavior of the extended Kalman filter
    as a parameter estimator for linear systems*, IEEE Trans. AC 24 (1979). Unlike the
    prediction-error method it corrects the state as well. The variance of θ_i stays below
    θ_i(0)², to which its row and column are scaled down. A sample that lies alone beyond 100 of
    its standard deviations is not used, and each after it counts as one of that size.

    P is claimed for θ that walks as W says. While θ stands still instead, in slow adaptation, the
    error has half that variance; after a jump, which W does not know, P is far too small.

    Parameters
    ----------
    design : Design
        With W, what the covariance of θ gains in every sample, as its drift. Where it has no noise
        R = σ² is learnt from the innovations, see `flexaxis.estimators.filters.noise`.
    """
    start = Memory(joint_arrays(design, heeds=HEEDS_NOTHING))
    return CompiledFilter("flexaxis.estimators.methods.loops:ekf", start, design, read_joint)


def _extended(
    problem: Problem,
    *,
    walk: float | None = None,
    spread: float = 0.2,
) -> CompiledFilter:
    """
    Make the joint extended Kalman filter.

    Parameters
    ----------
    walk : float
        Standard deviation of the random walk of every θ after a second, relative to θ(0).
    spread : float
        Standard deviation of θ(0), relative to it.
    """
    return joint_ekf(problem.walk_design("ekf", WALK, walk=walk, spread=spread))


ENTRIES = (
    Entry(
        "ekf",
        "joint extended Kalman filter for state and parameters",
        _extended,
        knob="walk",
        default=WALK,
        rank=7,
    ),
)
