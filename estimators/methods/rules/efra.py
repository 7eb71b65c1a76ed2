"""
Exponential forgetting and resetting: P ← P/λ + β S − γ P S⁻¹ P, with a floor and a ceiling on P.

M. E. Salgado, G. C. Goodwin and R. H. Middleton, *Modified least squares algorithm incorporating
exponential resetting and forgetting*, Int. J. Control 47 (1988) 477–491, with S = 10 diag P(0) in
the place of I, which has no units. β = ν/10, γ = ν/10, with ν = 1/λ − 1.
"""

import numpy as np

from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.forgetful import EFRA, forgetful_filter
from flexaxis.estimators.filters.prediction_error import CEILING, ROBUST
from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry


@inlined
def forget_and_reset(state):
    """Do the time update."""
    P, work, S = state.P, state.work, state.rates
    nu = 1.0 / state.now[0]["forgetting"] - 1.0
    p = len(P)
    for i in range(p):
        for j in range(p):
            total = 0.0
            for m in range(p):
                total += P[i, m] * P[m, j] / S[m]
            work[i, j] = total
    for i in range(p):
        for j in range(i + 1):
            fresh = S[i] if i == j else 0.0
            P[i, j] += nu * P[i, j] + 0.1 * nu * (fresh - work[i, j])
            P[j, i] = P[i, j]


def _efra(
    problem: Problem,
    *,
    forgetting: float | None = None,
    robust: float = ROBUST,
    ceiling: float = CEILING,
) -> CompiledFilter:
    """
    Make the method with this rule.

    Parameters
    ----------
    forgetting : float, optional
        λ of a sample.
    robust, ceiling
        As for `flexaxis.estimators.Rpem`.
    """
    design = problem.forgetting_design("efra", forgetting)
    return forgetful_filter(
        design,
        EFRA,
        robust=robust,
        ceiling=ceiling,
        rates=10 * np.diag(design.P0),
    )


ENTRIES = (
    Entry(
        "efra",
        "exponential forgetting and resetting, P bounded on both sides",
        _efra,
        knob="1-forgetting",
        default=0.995,
        rank=22,
    ),
)
