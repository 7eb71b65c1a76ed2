"""
The prediction-error method with other rules of forgetting: reset by a CUSUM, and a variable factor.

Reset P when the residual has grown: g ← max(0, g + 3/8 s − ln 2), s = ε²/(R̂(1+ψᵀPψ)), at most 16,
with the R̂ before the sample. It is the logarithm of the likelihood ratio of a fourfold variance
(E. S. Page, *Continuous inspection schemes*, Biometrika 41, 1954). When g exceeds the level, P
becomes the covariance of an unknown change, and g zero: F. Gustafsson, *Adaptive Filtering and
Change Detection*, Wiley 2000, ch. 3.

A factor that follows the residual, λ = σ_q σ_v/|σ_e − σ_v|, at most the λ that is set. It forgets
only while the residual is large. C. Paleologu, J. Benesty and S. Ciochină, *A robust variable
forgetting factor recursive least-squares algorithm for system identification*, IEEE Signal
Processing Letters 15 (2008) 597–600. σ_e² and σ_q², means of ε² and (ψᵀPψ)², have a memory of
0.3 s; σ_v², of the noise, has one of 2 s. Earlier they are exact means.
"""

from flexaxis.estimators.filters.design import above_zero
from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.forgetting import CUSUM, VARIABLE, forgetful_filter
from flexaxis.estimators.filters.noise import KNOWN
from flexaxis.estimators.filters.prediction_error import CALM, CEILING, ROBUST
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


SHORT, LONG = 0.3, 2.0  # s, memories of the residual and of the noise: 60 and 400 samples at 5 ms
FASTEST = 0.05  # s, least time constant of forgetting; λ = 0.9 at 5 ms


def _variable_forgetting(
    problem: Problem,
    *,
    forgetting: float | None = None,
    level: float = 2.0,
    robust: float = ROBUST,
    ceiling: float = CALM,
) -> CompiledFilter:
    """
    Make the method with this rule.

    Parameters
    ----------
    forgetting : float, optional
        Largest λ of a sample.
    level : float
        How far the residual must exceed the noise, in standard deviations, to forget more.
    robust, ceiling
        As for `flexaxis.estimators.Rpem`.
    """
    design = problem.forgetting_design("variable-forgetting", forgetting)
    above_zero("level", level, "a ratio of standard deviations")
    return forgetful_filter(
        design,
        VARIABLE,
        robust=robust,
        ceiling=ceiling,
        level=level,
        short=max(SHORT / problem.period, 2.0),
        long=max(LONG / problem.period, 2.0),
        least=max(1 - problem.period / FASTEST, 0.5),
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
    Entry(
        "variable-forgetting",
        "forgets while the residual is large",
        _variable_forgetting,
        knob="1-forgetting",
        default=0.995,
        rank=23,
    ),
)
