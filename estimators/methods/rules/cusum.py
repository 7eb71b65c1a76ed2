"""
Reset P when the residual has grown, by a CUSUM.

g ← max(0, g + 3/8 s − ln 2), s = ε²/(σ²(1+ψᵀPψ)), at most 16: the logarithm of the likelihood ratio
of a variance four times what it was (E. S. Page, *Continuous inspection schemes*, Biometrika 41,
1954). At g above the level P becomes what an unknown change may be, and g zero: F. Gustafsson,
*Adaptive Filtering and Change Detection*, Wiley 2000, ch. 3.
"""

from flexaxis.estimators.sampling.compiler import jit


@jit
def reset_on_alarm(tuning, state, scale, quiet):
    """Put P to a large value where the sum exceeds the level."""
    square = min(state["epsilon"] ** 2 / (quiet * (1.0 + scale)), 16.0)
    sums, P = state["sums"], state["P"]
    sums[3] += 1.0
    sums[0] = max(0.0, sums[0] + 0.375 * square - 0.693)
    if sums[0] > tuning["level"] and sums[3] > 200.0:
        sums[0] = 0.0
        sums[3] = 100.0  # half a second before the next
        for i in range(len(P)):
            for j in range(len(P)):
                P[i, j] = tuning["reset_P"][i, j]
