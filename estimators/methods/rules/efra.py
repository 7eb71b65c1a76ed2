"""
Exponential forgetting and resetting: P ← P/λ + β S − γ P S⁻¹ P, with a floor and a ceiling on P.

M. E. Salgado, G. C. Goodwin and R. H. Middleton, *Modified least squares algorithm incorporating
exponential resetting and forgetting*, Int. J. Control 47 (1988) 477–491, with S = 10 P(0) in the
place of I, which has no units. β = ν/10, γ = ν/10, with ν = 1/λ − 1.
"""

from flexaxis.estimators.sampling.compiler import jit


@jit
def forget_and_reset(tuning, state):
    """Do the time update."""
    P, work, S = state["P"], state["work"], tuning["reset_P"]
    nu = 1.0 / tuning["forgetting"] - 1.0
    p = len(P)
    for i in range(p):
        for j in range(p):
            total = 0.0
            for m in range(p):
                total += P[i, m] * P[m, j] / S[m, m]
            work[i, j] = total
    for i in range(p):
        for j in range(i + 1):
            P[i, j] += nu * P[i, j] + 0.1 * nu * (S[i, j] - work[i, j])
            P[j, i] = P[i, j]
