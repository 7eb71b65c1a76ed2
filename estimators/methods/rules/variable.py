"""
A factor that follows the residual: λ = σ_q σ_v/|σ_e − σ_v|, at most that which is set.

It forgets only while the residual is large. C. Paleologu, J. Benesty and S. Ciochină, *A robust
variable forgetting factor recursive least-squares algorithm for system identification*, IEEE
Signal Processing Letters 15 (2008) 597–600. σ_e and σ_q, of residual and ψᵀPψ, have a memory of 60
samples; σ_v, of the noise, one of 400.
"""

import numpy as np

from flexaxis.estimators.sampling.compiler import jit


@jit
def variable_factor(tuning, state, scale):
    """Return λ."""
    sums, epsilon = state["sums"], state["epsilon"]
    sums[0] += (epsilon**2 - sums[0]) / 60.0
    sums[1] += (scale**2 - sums[1]) / 60.0
    sums[2] += (epsilon**2 - sums[2]) / 400.0
    e, q, v = np.sqrt(sums[0]), np.sqrt(sums[1]), np.sqrt(sums[2])
    highest = tuning["forgetting"]
    if e <= tuning["level"] * v or e - v < 1e-12:
        return highest
    return max(min(q * v / (1e-12 + e - v), highest), 0.9)
