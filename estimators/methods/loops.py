"""
The loops of the filters over their samples: the methods, in a few lines each.

Each takes a block of memory and where its arrays are, `at`; see
`flexaxis.estimators.filters.filter.CompiledFilter`. Linear models have loops of their own, which
compile in a fraction of the time. θ[k] uses y[k], and u[k] is not yet in x then.
"""

from flexaxis.estimators.filters.forgetting import forget
from flexaxis.estimators.filters.interacting_models import (
    listen,
    mix,
    mixture,
    mode_in,
    weigh,
)
from flexaxis.estimators.filters.joint import joint_in, look, predict, predict_with_laws, update
from flexaxis.estimators.filters.noise import judge, show
from flexaxis.estimators.filters.prediction_error import (
    bound_P,
    correct_state,
    measure,
    publish,
    recursion_in,
)
from flexaxis.estimators.models.compiler import inlined, loop
from flexaxis.estimators.models.series import lawful_sample, linear_sample


@loop
def rpem(block, at, u, y, valid, estimates, trace):  # noqa: PLR0917
    """Take samples of a recursive prediction-error method, eq. (5)–(23)."""
    state = recursion_in(block, at)
    for k in range(len(u)):
        measure(state, y[k], valid[k])  # (5)–(7)
        correct_state(state)
        forget(state, valid[k])  # (9) or (10), (12), or another rule
        bound_P(state)
        publish(state, k, estimates, trace)
        linear_sample(state.axis, state.theta, state.X, u[k])  # (17)–(23)
        if state.now[0]["anew"] > state.now[0]["heeds"]:
            return -k - 1
    return len(u)


@loop
def rpem_with_laws(block, at, u, y, valid, estimates, trace):  # noqa: PLR0917
    """Do as `rpem` for models with laws."""
    state = recursion_in(block, at)
    for k in range(len(u)):
        measure(state, y[k], valid[k])
        correct_state(state)
        forget(state, valid[k])
        bound_P(state)
        publish(state, k, estimates, trace)
        lawful_sample(state.axis, state.theta, state.X, u[k])
        if state.now[0]["anew"] > state.now[0]["heeds"]:
            return -k - 1
    return len(u)


@loop
def ekf(block, at, u, y, valid, estimates, trace):  # noqa: PLR0917
    """Take samples of a joint extended Kalman filter."""
    state = joint_in(block, at)
    for k in range(len(u)):
        _update(state, y[k], valid[k], estimates[k], trace[k])
        predict(state, u[k])
    return len(u)


@loop
def ekf_with_laws(block, at, u, y, valid, estimates, trace):  # noqa: PLR0917
    """Do as `ekf` for models with laws."""
    state = joint_in(block, at)
    for k in range(len(u)):
        _update(state, y[k], valid[k], estimates[k], trace[k])
        predict_with_laws(state, u[k])
    return len(u)


@inlined
def _update(state, y, valid, estimates, trace):
    """Take a joint filter through a measurement; write η, and ŷ, innovation and its variance."""
    now = state.now[0]
    look(state)
    used = judge(now, y, valid, state.X[-1, 0], now["spread"])
    update(state, used, now["noise"])
    for i in range(len(estimates)):
        estimates[i] = state.theta[i]
    show(now, trace)


@loop
def imm(blocks, at, u, y, valid, estimates, trace):  # noqa: PLR0917
    """Take samples of interacting multiple models."""
    for k in range(len(u)):
        _update_modes(blocks, at, y[k], valid[k], estimates[k], trace[k])
        for j in range(len(blocks)):
            predict(joint_in(blocks[j], at), u[k])
        if mode_in(blocks[0], at).now[0]["anew"] > 0.0:
            return -k - 1
    return len(u)


@loop
def imm_with_laws(blocks, at, u, y, valid, estimates, trace):  # noqa: PLR0917
    """Do as `imm` for models with laws."""
    for k in range(len(u)):
        _update_modes(blocks, at, y[k], valid[k], estimates[k], trace[k])
        for j in range(len(blocks)):
            predict_with_laws(joint_in(blocks[j], at), u[k])
        if mode_in(blocks[0], at).now[0]["anew"] > 0.0:
            return -k - 1
    return len(u)


@inlined
def _update_modes(blocks, at, y, valid, estimates, trace):  # noqa: PLR0917
    """Take all modes through a measurement, weigh and mix them; write what `_update` does."""
    for j in range(len(blocks)):
        state = joint_in(blocks[j], at)
        look(state)
        state.now[0]["output"] = state.X[-1, 0]
    prediction, spread = mixture(blocks, at)
    now = mode_in(blocks[0], at).now[0]
    used = judge(now, y, valid, prediction, spread)
    noise = now["noise"]
    for j in range(len(blocks)):
        state = joint_in(blocks[j], at)
        listen(state.now[0], used, noise)
        update(state, used, noise)
    weigh(blocks, at, estimates)
    mix(blocks, at)
    show(now, trace)
