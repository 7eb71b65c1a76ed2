"""
Forget along the gradient only: P ← P + (1/λ − 1) ψψᵀ/(ψᵀP⁻¹ψ), so standstill forgets nothing.

L. Cao and H. M. Schwartz, *A directional forgetting algorithm based on the decomposition of the
information matrix*, Automatica 36 (2000) 1725–1731; for one output SIFt-RLS of B. Lai and D. S.
Bernstein (2024) is the same, with a gradient too small to count left out.
"""

import numpy as np

from flexaxis.estimators.sampling.compiler import jit


@jit
def forget_excited(tuning, state):
    """Do the time update."""
    P, psi, v, L = state["P"], state["psi"], state["gain"], state["work"]
    p = len(P)
    size = 0.0
    for i in range(p):  # Cholesky and forward substitution: ψᵀP⁻¹ψ = |L⁻¹ψ|²
        total = psi[i]
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
    if size > 1e-9:
        for i in range(p):
            for j in range(p):
                P[i, j] += (1.0 / tuning["forgetting"] - 1.0) * psi[i] * psi[j] / size
