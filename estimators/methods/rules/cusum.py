"""
Reset P when the residual has grown, by a CUSUM.

g ← max(0, g + 3/8 s − ln 2), s = ε²/(R̂(1+ψᵀPψ)), at most 16, with R̂ from before: the logarithm of
the likelihood ratio of a variance four times what it was (E. S. Page, *Continuous inspection
schemes*, Biometrika 41, 1954). At g above the level P becomes what an unknown change may be, and g
zero: F. Gustafsson, *Adaptive Filtering and Change Detection*, Wiley 2000, ch. 3.
"""

import numpy as np

from flexaxis.estimators.filters.design import above_zero
from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.forgetful import CUSUM, forgetful_filter
from flexaxis.estimators.filters.noise import KNOWN
from flexaxis.estimators.filters.prediction_error import CEILING, LINEAR, ROBUST
from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry

FIRST, NEXT = 1.0, 0.5  # s before the first alarm, in which R̂ is learnt, and between two


@inlined
def reset_on_alarm(state, valid):
    """P ← P/λ, eq. (9); where the sum exceeds the level, P becomes large."""
    P, now = state.P, state.now[0]
    sums = now["sums"]
    for i in range(len(P)):
        for j in range(len(P)):
            P[i, j] /= now["forgetting"]
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


def _cusum_reset(
    problem: Problem,
    *,
    forgetting: float | None = None,
    reset: float = 0.1,
    level: float = 10.0,
    robust: float = ROBUST,
    ceiling: float = CEILING,
) -> CompiledFilter:
    """
    Make the method with this rule.

    Parameters
    ----------
    forgetting : float, optional
        λ of a sample, between alarms.
    reset : float
        What P is reset to, as a standard deviation relative to θ(0).
    level : float
        Alarm threshold [nats].
    robust, ceiling
        As for `flexaxis.estimators.Rpem`.
    """
    design = problem.forgetting_design("cusum-reset", forgetting)
    above_zero("level", level, "an alarm threshold in nats")
    return forgetful_filter(
        design,
        CUSUM,
        robust=robust,
        ceiling=ceiling,
        correct=True,  # P is large after an alarm: the state has to follow
        reset=above_zero("reset", reset, "a standard deviation relative to θ(0)") ** 2,
        level=level,
        first=max(FIRST / problem.period, KNOWN),
        next=NEXT / problem.period,
    )


ENTRIES = (
    Entry(
        "cusum-reset",
        "rpem-forgetting whose P is reset when a CUSUM on the residual raises an alarm",
        _cusum_reset,
        knob="1-forgetting",
        default=0.995,
        rank=24,
    ),
)
