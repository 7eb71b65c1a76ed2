"""
The sample loops of the filters; each loop implements one estimation method in a few lines.

The class `flexaxis.estimators.filters.filter.CompiledFilter` calls the sample loops. The arguments
of each loop include the memory block of the filter and the positions ``at`` of the arrays in the
block. The argument ``laws`` is None for a linear model. The compiled code for a linear model does
not contain nonlinear torques, so compilation is much faster. Each loop computes θ[k] from y[k]
before u[k] acts on the state x.
"""

from flexaxis.estimators.filters.forgetting import forget
from flexaxis.estimators.filters.interacting_models import (
    Modes,
    mix,
    mixture,
    mode,
    weigh,
)
from flexaxis.estimators.filters.joint import Joint, look, predict, update
from flexaxis.estimators.filters.noise import allow_for_torques, judge, show
from flexaxis.estimators.filters.prediction_error import Recursion, bound_P, measure
from flexaxis.estimators.models.compiler import inlined, loop
from flexaxis.estimators.models.memory import views
from flexaxis.estimators.models.series import over_sample


@loop
def rpem(block, at, u, y, valid, estimates, trace, laws):  # noqa: PLR0917
    """Process samples with the recursive prediction-error method, equations (5)–(23)."""
    state = views(Recursion, block, at)
    for k in range(len(u)):
        measure(state, y[k], valid[k])  # (5)–(7)
        forget(state, valid[k])  # (9) or (10), (12), or another rule
        bound_P(state)
        _publish(state, estimates[k], trace[k])
        over_sample(state.axis, state.theta, state.X, u[k], laws)  # (17)–(23)
        if state.now[0]["anew"] > state.now[0]["heeds"]:
            return -k - 1
    return len(u)


@loop
def ekf(block, at, u, y, valid, estimates, trace, laws):  # noqa: PLR0917
    """Process samples with the joint extended Kalman filter."""
    state = views(Joint, block, at)
    now = state.now[0]
    for k in range(len(u)):
        look(state)
        used = judge(now, y[k], valid[k], state.X[-1, 0], now["spread"])
        update(state, used, now["noise"])
        allow_for_torques(now)
        _publish(state, estimates[k], trace[k])
        predict(state, u[k], laws)
    return len(u)


@inlined
def _publish(state, estimates, trace):
    """Write θ[k] to ``estimates``, and ŷ[k], the innovation and its variance to ``trace``."""
    for i in range(len(estimates)):
        estimates[i] = state.theta[i]
    show(state.now[0], trace)


@loop
def imm(block, at, u, y, valid, estimates, trace, laws):  # noqa: PLR0917
    """Process samples with the interacting-multiple-model filter."""
    modes = views(Modes, block, at)
    now, quiet = modes.now, modes.now[0]
    for k in range(len(u)):
        for j in range(len(now)):
            look(mode(modes, j))
        prediction, spread = mixture(now, modes.X)
        used = judge(quiet, y[k], valid[k], prediction, spread)
        noise = quiet["noise"]
        for j in range(len(now)):
            update(mode(modes, j), used, noise)
        allow_for_torques(quiet)
        now["torque_noise"][:] = quiet["torque_noise"]
        weigh(modes, used, noise, estimates[k])
        mix(modes)
        show(quiet, trace[k])
        for j in range(len(now)):
            predict(mode(modes, j), u[k], laws)
        if quiet["anew"] > 0.0:
            return -k - 1
    return len(u)
