"""The loop of the prediction-error method with another rule of forgetting: see `rules`."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from flexaxis.estimators.methods.rules.cusum import reset_on_alarm
from flexaxis.estimators.methods.rules.directional import forget_excited
from flexaxis.estimators.methods.rules.efra import forget_and_reset
from flexaxis.estimators.methods.rules.variable import variable_factor
from flexaxis.estimators.methods.rules.vector import forget_each
from flexaxis.estimators.recursion.kernel import (
    correct_state,
    grown,
    measure,
    state_type,
    tuning_type,
)
from flexaxis.estimators.sampling.compiler import compile_loop, jit
from flexaxis.estimators.sampling.lanes import advance, evaluate
from flexaxis.estimators.sampling.pattern import Pattern

RULES = ("vector", "directional", "efra", "variable", "cusum")


def rule_tuning_type(pattern: Pattern) -> np.dtype:
    """Return the record type of `tuning_type` and what the rules need."""
    p = pattern.p
    extra = [("rule", int), ("rates", float, (p,)), ("reset_P", float, (p, p)), ("level", float)]
    return grown(tuning_type(pattern), extra)


def rule_state_type(pattern: Pattern) -> np.dtype:
    """Return the record type of `state_type` and what the rules remember."""
    p = pattern.p
    return grown(state_type(pattern), [("work", float, (p, p)), ("sums", float, (4,))])


@lru_cache
def rule_loop(pattern: Pattern) -> Callable:
    """Return the compiled loop, as `flexaxis.estimators.recursion.kernel.rpem_loop`."""
    flat = pattern.flat()

    def run(tunings, states, u, y, valid, estimates):  # noqa: PLR0917
        tuning, state = tunings[0], states[0]
        for k in range(len(u)):
            quiet = state["noise"]
            scale = spread(state)
            measure(tuning, state, y[k], valid[k])
            if tuning["correct"] > 0.0:
                correct_state(state)
            if valid[k]:
                apply(tuning, state, scale, quiet)
            evaluate(flat, tuning["coefficients"], state["theta"], state["M"])
            advance(
                flat,
                state["M"],
                state["X"],
                u[k],
                tuning["weights"],
                tuning["order"],
                tuning["substeps"],
            )
            for i in range(len(state["theta"])):
                estimates[k, i] = state["theta"][i]

    return compile_loop(run, flat, rule_tuning_type(pattern), rule_state_type(pattern))


@jit
def spread(state):
    """Return ψᵀPψ before the measurement."""
    X, P = state["X"], state["P"]
    total = 0.0
    for i in range(len(P)):
        for j in range(len(P)):
            total += X[-1, 1 + i] * P[i, j] * X[-1, 1 + j]
    return total


@jit
def apply(tuning, state, scale, quiet):
    """Do the time update of the rule that is set; RULES has them in this order."""
    rule = tuning["rule"]
    if rule == 0:
        forget_each(tuning, state)
    elif rule == 1:
        forget_excited(tuning, state)
    elif rule == 2:
        forget_and_reset(tuning, state)
    elif rule == 3:
        forget_all(state["P"], variable_factor(tuning, state, scale))
    else:
        forget_all(state["P"], tuning["forgetting"])
        reset_on_alarm(tuning, state, scale, quiet)


@jit
def forget_all(P, factor):
    """P ← P/λ, eq. (9)."""
    for i in range(len(P)):
        for j in range(len(P)):
            P[i, j] /= factor
