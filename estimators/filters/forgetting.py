"""
Rules of forgetting: what takes P over the time update, the paper's eq. (9), (10), (12) or another.

Each rule is a compiled function of the state and of whether the sample was used, with a number by
which `forget` finds it. Their sources are in the modules of `flexaxis.estimators.methods`.
"""

import numpy as np

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.prediction_error import (
    LINEAR,
    read_claim,
    recursion,
    time_update,
)
from flexaxis.estimators.models.compiler import inlined

PAPER, CUSUM, VARIABLE = range(3)
LOOP = "flexaxis.estimators.methods.loops:rpem"


@inlined
def forget(state, valid):
    """Take P over the time update, by the rule of the filter."""
    rule = state.now[0]["rule"]
    if rule == PAPER:
        time_update(state)
    elif rule == CUSUM:
        reset_on_alarm(state, valid)
    elif rule == VARIABLE:
        forget_by_residual(state, valid)


@inlined
def reset_on_alarm(state, valid):
    """P ← P/λ, eq. (9); where the sum of a CUSUM exceeds the level, P becomes large."""
    P, now = state.P, state.now[0]
    sums = now["sums"]
    _divide(P, now["forgetting"])
    if not valid or not now["variance"] > 0.0:
        return
    square = min(now["epsilon"] ** 2 / (now["quiet"] * now["scale"]), 16.0)
    sums[1] += 1.0
    sums[0] = max(0.0, sums[0] + 0.375 * square - np.log(2.0))
    if sums[0] > now["level"] and sums[1] > now["first"]:
        sums[0] = 0.0
        sums[1] = now["first"] - now["next"]
        variance = now["reset"] / max(now["noise"], LINEAR**2 * now["signal"])
        for i in range(len(P)):
            state.granted[i] = variance
            for j in range(len(P)):
                P[i, j] = variance if i == j else 0.0
                state.claim[i, j] = P[i, j]


@inlined
def forget_by_residual(state, valid):
    """P ← P/λ with a λ that follows the residual; a gap has none, and forgets nothing."""
    if valid:
        _divide(state.P, _variable_factor(state.now[0]))


@inlined
def _variable_factor(now):
    """Return λ."""
    sums, square = now["sums"], now["surprise"] ** 2
    sums[3] += 1.0
    short, long = min(sums[3], now["short"]), min(sums[3], now["long"])
    sums[0] += (square - sums[0]) / short
    sums[1] += ((now["scale"] - 1.0) ** 2 - sums[1]) / short
    sums[2] += (square - sums[2]) / long
    e, q, v = np.sqrt(sums[0]), np.sqrt(sums[1]), np.sqrt(sums[2])
    highest = now["forgetting"]
    if e <= now["level"] * v:
        return highest
    return max(min(q * v / (e - v), highest), now["least"])


@inlined
def _divide(P, factor):
    for i in range(len(P)):
        for j in range(len(P)):
            P[i, j] /= factor


def forgetful_filter(
    design: Design,
    rule: int,
    *,
    robust: float,
    ceiling: float,
    correct: bool = False,
    **more: float,
) -> CompiledFilter:
    """
    Make a prediction-error method with a rule of its own in the place of eq. (9) or (10).

    Parameters
    ----------
    design : Design
    rule : int
        Of the above.
    robust, ceiling, correct, **more
        As for `flexaxis.estimators.filters.prediction_error.recursion`.
    """
    start = recursion(design, robust=robust, ceiling=ceiling, correct=correct, rule=rule, **more)
    return CompiledFilter(LOOP, start, design, read_claim)
