"""
Rules of forgetting: the time update of P with the paper's eq. (9), (10), (12) or another rule.

Each rule has a number, which `forget` uses to select the rule, and a compiled function of the state
and of whether y was measured. The modules of `flexaxis.estimators.methods` contain references to
the literature.
"""

from typing import Any

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
    """Perform the time update of P according to the rule of the filter."""
    rule = state.now[0]["rule"]
    if rule == PAPER:
        time_update(state)
    elif rule == CUSUM:
        reset_on_alarm(state, valid)
    elif rule == VARIABLE:
        forget_by_residual(state, valid)


@inlined
def reset_on_alarm(state, valid):
    """Compute P ← P/λ, eq. (9); if the CUSUM exceeds the alarm level, reset P to a large value."""
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
    """Compute P ← P/λ with a λ that depends on the residual; nothing is forgotten in a gap."""
    if valid:
        _divide(state.P, _variable_factor(state.now[0]))


@inlined
def _variable_factor(now):
    """Update the means of squares, and return the forgetting factor λ."""
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


def forgetful_filter(design: Design, rule: int, **options: Any) -> CompiledFilter:
    """
    Return a prediction-error method with a different rule of forgetting than eq. (9) or (10).

    Parameters
    ----------
    design : Design
    rule : int
        Number of the rule: ``CUSUM`` or ``VARIABLE``.
    **options
        Options of `flexaxis.estimators.filters.prediction_error.recursion`.
    """
    return CompiledFilter(LOOP, recursion(design, rule=rule, **options), design, read_claim)
