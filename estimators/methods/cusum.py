"""
Reset P when the residual has grown, by a CUSUM.

g ← max(0, g + 3/8 s − ln 2), s = ε²/(R̂(1+ψᵀPψ)), at most 16, with R̂ from before: the logarithm of
the likelihood ratio of a variance four times what it was (E. S. Page, *Continuous inspection
schemes*, Biometrika 41, 1954). At g above the level P becomes what an unknown change may be, and g
zero: F. Gustafsson, *Adaptive Filtering and Change Detection*, Wiley 2000, ch. 3.
"""

from flexaxis.estimators.filters.design import above_zero
from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.forgetting import CUSUM, forgetful_filter
from flexaxis.estimators.filters.noise import KNOWN
from flexaxis.estimators.filters.prediction_error import CEILING, ROBUST
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry

FIRST, NEXT = 1.0, 0.5  # s before the first alarm, in which R̂ is learnt, and between two


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
