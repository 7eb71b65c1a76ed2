"""
A factor that follows the residual: λ = σ_q σ_v/|σ_e − σ_v|, at most that which is set.

It forgets only while the residual is large. C. Paleologu, J. Benesty and S. Ciochină, *A robust
variable forgetting factor recursive least-squares algorithm for system identification*, IEEE
Signal Processing Letters 15 (2008) 597–600. σ_e² and σ_q², means of ε² and (ψᵀPψ)², have a memory
of 0.3 s; σ_v², of the noise, one of 2 s; exact means before they have seen as much.
"""

from flexaxis.estimators.filters.design import above_zero
from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.forgetting import VARIABLE, forgetful_filter
from flexaxis.estimators.filters.prediction_error import CALM, ROBUST
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry

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
        "variable-forgetting",
        "forgets while the residual is large",
        _variable_forgetting,
        knob="1-forgetting",
        default=0.995,
        rank=23,
    ),
)
