"""
Forgetting rules for the matrix P: equations (9), (10) and (12), and two other update rules.

`forget` selects the forgetting rule by its number. The docstrings in `flexaxis.estimators.methods`
cite the literature on the forgetting rules.
"""

import numpy as np

from flexaxis.estimators.filters.prediction_error import LINEAR, grow
from flexaxis.estimators.models.compiler import inlined

PAPER, CUSUM, VARIABLE = range(3)


@inlined
def forget(state, valid):
    """Perform the time update of P according to the filter's forgetting rule."""
    now = state.now[0]
    rule, factor = now["rule"], now["forgetting"]
    if rule == VARIABLE:
        factor = _variable_factor(now) if valid else 1.0
    # the gain is no longer needed: reuse its memory
    grow(state.P, state.gain, factor, state.drift, state.regularization)
    if rule == CUSUM and valid and now["innovation_variance"] > 0.0:
        reset_on_alarm(state)


@inlined
def reset_on_alarm(state):
    """Update the CUSUM statistic, and reset P if the statistic exceeds the alarm level."""
    P, now = state.P, state.now[0]
    sums = now["sums"]
    square = min(now["innovation"] ** 2 / (now["quiet"] * now["scale"]), 16.0)
    sums[1] += 1.0
    sums[0] = max(0.0, sums[0] + 0.375 * square - np.log(2.0))
    if sums[0] > now["level"] and sums[1] > now["first"]:
        sums[0] = 0.0
        sums[1] = now["first"] - now["next"]
        variance = now["reset"] / max(now["noise"], LINEAR**2 * now["signal"])
        for i in range(len(P)):
            state.granted[i] = variance
            for j in range(len(P)):
                P[i, j] = state.claim[i, j] = variance if i == j else 0.0


@inlined
def _variable_factor(now):
    """Update the mean squares of the residuals, and return the forgetting factor λ."""
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
