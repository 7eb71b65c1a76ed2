"""
A forgetting factor for each parameter: P_ij ← P_ij/√(λ_i λ_j).

S. Sælid and B. Foss, *Adaptive controllers with a vector variable forgetting factor*, 22nd IEEE
Conference on Decision and Control (1983) 1488–1494.
"""

import numpy as np

from flexaxis.estimators.sampling.compiler import jit


@jit
def forget_each(tuning, state):
    """Do the time update."""
    P, rates = state["P"], tuning["rates"]
    for i in range(len(P)):
        for j in range(len(P)):
            P[i, j] /= np.sqrt(rates[i] * rates[j])
