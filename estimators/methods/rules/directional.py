"""
Forget along the gradient only: P ← P + (1/λ − 1) ψψᵀ/(ψᵀP⁻¹ψ), so standstill forgets nothing.

L. Cao and H. M. Schwartz, *A directional forgetting algorithm based on the decomposition of the
information matrix*, Automatica 36 (2000) 1725–1731; for one output SIFt-RLS of B. Lai and D. S.
Bernstein (2024) is the same, with a gradient too small to count left out. ψ is a slope and the
columns of P are steps, so that the formula has a meaning only once parameters are measured in a
unit: here in √P(0)_ii, the deviation that a nominal run leaves, in which all are excited alike. In
any other units v = diag(P(0)) ψ takes the place of ψ: P ← P + (1/λ − 1) v vᵀ/(vᵀP⁻¹v).
"""

import numpy as np

from flexaxis.estimators.filters.filter import CompiledFilter
from flexaxis.estimators.filters.forgetful import DIRECTIONAL, forgetful_filter
from flexaxis.estimators.filters.prediction_error import ASLEEP, CALM, ROBUST
from flexaxis.estimators.models.compiler import inlined
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry


@inlined
def forget_excited(state, valid):
    """Do the time update; a gap renews nothing, and so forgets nothing."""
    P, along, v, L, now = state.P, state.along, state.gain, state.work, state.now[0]
    p = len(P)
    excitation = 0.0
    for i in range(p):
        excitation += state.psi[i] ** 2
        along[i] = state.rates[i] * state.psi[i]
    if not valid or excitation <= ASLEEP * now["noise"]:
        return
    size = 0.0
    for i in range(p):  # Cholesky and forward substitution: vᵀP⁻¹v = |L⁻¹v|²
        total = along[i]
        for j in range(i + 1):
            entry = P[i, j]
            for m in range(j):
                entry -= L[i, m] * L[j, m]
            if i == j:
                L[i, i] = np.sqrt(max(entry, 1e-300))
            else:
                L[i, j] = entry / L[j, j]
                total -= L[i, j] * v[j]
        v[i] = total / L[i, i]
        size += v[i] ** 2
    for i in range(p):
        for j in range(p):
            P[i, j] += (1.0 / now["forgetting"] - 1.0) * along[i] * along[j] / size


def _directional_forgetting(
    problem: Problem,
    *,
    forgetting: float | None = None,
    robust: float = ROBUST,
    ceiling: float = CALM,
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
    design = problem.forgetting_design("directional-forgetting", forgetting)
    return forgetful_filter(
        design,
        DIRECTIONAL,
        robust=robust,
        ceiling=ceiling,
        rates=np.diag(design.P0),
    )


ENTRIES = (
    Entry(
        "directional-forgetting",
        "forgets along the gradient only (SIFt)",
        _directional_forgetting,
        knob="1-forgetting",
        default=0.995,
        rank=21,
    ),
)
