"""Prediction-error methods by their rule for the time update of P: the paper's, or another."""

from numpy.typing import ArrayLike

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.prediction_error import read_claim, recursion

PAPER, CUSUM, DIRECTIONAL, EFRA, VARIABLE, VECTOR = range(6)
"""The rules, as compiled code knows them."""
LOOP = "flexaxis.estimators.methods.loops:rpem"


def forgetful_filter(
    design: Design,
    rule: int,
    *,
    robust: float,
    ceiling: float,
    correct: bool = False,
    rates: ArrayLike = 0.0,
    **more: float,
) -> CompiledFilter:
    """
    Make a prediction-error method with a rule of its own in the place of eq. (9) or (10).

    Parameters
    ----------
    design : Design
    rule : int
        Of the above.
    robust, ceiling, correct, rates, **more
        As for `flexaxis.estimators.filters.prediction_error.recursion`.
    """
    start = recursion(
        design, robust=robust, correct=correct, ceiling=ceiling, rates=rates, rule=rule, **more
    )
    return CompiledFilter(LOOP, start, design, read_claim)
