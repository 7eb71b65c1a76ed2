"""
Other time updates of P for the prediction-error method: what to forget, how much, and when.

Each is a rule that takes the place of eq. (9) and (10); model, predictor, gradient and measurement
update are those of `flexaxis.estimators.kernel`.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from flexaxis.estimators.compiler import compile_loop, jit
from flexaxis.estimators.kernel import correct_state, grown, measure, state_type, tuning_type
from flexaxis.estimators.lanes import advance, evaluate
from flexaxis.estimators.pattern import Pattern

RULES = ("vector", "directional", "efra", "variable", "cusum")


def rule_tuning_type(pattern: Pattern) -> np.dtype:
    """Return the record type of `tuning_type` and what the rules need."""
    p = pattern.p
    extra = [("rule", int), ("rates", float, (p,)), ("reset_P", float, (p, p)), ("level", float)]
    return grown(tuning_type(pattern), extra)


def rule_state_type(pattern: Pattern) -> np.dtype:
    """Return the record type of `state_type` and what the rules remember."""
    p = pattern.p
    return grown(state_type(pattern), [("work", float, (p, p)), ("sums", float, (4,))])


@lru_cache
def rule_loop(pattern: Pattern) -> Callable:
    """Return the compiled loop, as `flexaxis.estimators.kernel.rpem_loop`."""
    flat = pattern.flat()

    def run(tunings, states, u, y, valid, estimates):  # noqa: PLR0917
        tuning, state = tunings[0], states[0]
        for k in range(len(u)):
            quiet = state["noise"]
            scale = spread(state)
            measure(tuning, state, y[k], valid[k])
            if tuning["correct"] > 0.0:
                correct_state(state)
            if valid[k]:
                apply(tuning, state, scale, quiet)
            evaluate(flat, tuning["coefficients"], state["theta"], state["M"])
            advance(
                flat,
                state["M"],
                state["X"],
                u[k],
                tuning["weights"],
                tuning["order"],
                tuning["substeps"],
            )
            for i in range(len(state["theta"])):
                estimates[k, i] = state["theta"][i]

    return compile_loop(run, flat, rule_tuning_type(pattern), rule_state_type(pattern))


@jit
def spread(state):
    """Return ψᵀPψ before the measurement."""
    X, P = state["X"], state["P"]
    total = 0.0
    for i in range(len(P)):
        for j in range(len(P)):
            total += X[-1, 1 + i] * P[i, j] * X[-1, 1 + j]
    return total


@jit
def apply(tuning, state, scale, quiet):
    """Do the time update of the rule that is set."""
    rule = tuning["rule"]
    if rule == 0:
        forget_each(state["P"], tuning["rates"])
    elif rule == 1:
        forget_excited(tuning["forgetting"], state)
    elif rule == 2:
        forget_and_reset(tuning, state)
    elif rule == 3:
        forget_all(state["P"], variable_factor(tuning, state, scale))
    else:
        forget_all(state["P"], tuning["forgetting"])
        reset_on_alarm(tuning, state, scale, quiet)


@jit
def forget_all(P, factor):
    """P ← P/λ, eq. (9)."""
    for i in range(len(P)):
        for j in range(len(P)):
            P[i, j] /= factor


@jit
def forget_each(P, rates):
    """P_ij ← P_ij/√(λ_i λ_j), a factor for each parameter (Sälid, Jensen and Fossen 1985)."""
    for i in range(len(P)):
        for j in range(len(P)):
            P[i, j] /= np.sqrt(rates[i] * rates[j])


@jit
def forget_excited(factor, state):
    """
    P ← P + (1/λ − 1) ψψᵀ/(ψᵀP⁻¹ψ): forget along ψ only, so that standstill forgets nothing.

    L. Cao and H. M. Schwartz, Automatica 36 (2000) 1725–1731; for one output, SIFt-RLS of B. Lai
    and D. S. Bernstein (2024) is the same, with a gradient too small to count left out.
    """
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
                P[i, j] += (1.0 / factor - 1.0) * psi[i] * psi[j] / size


@jit
def forget_and_reset(tuning, state):
    """
    P ← P/λ + β S − γ P S⁻¹ P: exponential forgetting with a floor and a ceiling on P.

    M. E. Salgado, G. C. Goodwin and R. H. Middleton, Int. J. Control 47 (1988) 477–491, with
    S = P(0) in the place of I, which has no units. β = ν/10, γ = ν/10, with ν = 1/λ − 1.
    """
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


@jit
def variable_factor(tuning, state, scale):
    """
    λ = σ_q σ_v/|σ_e − σ_v|, at most that which is set: forget only while the residual is large.

    C. Paleologu, J. Benesty and S. Ciochină, IEEE Signal Proc. Letters 15 (2008) 597–600. σ_e and
    σ_q, of residual and ψᵀPψ, have a memory of 60 samples; σ_v, of the noise, one of 400.
    """
    sums, epsilon = state["sums"], state["epsilon"]
    sums[0] += (epsilon**2 - sums[0]) / 60.0
    sums[1] += (scale**2 - sums[1]) / 60.0
    sums[2] += (epsilon**2 - sums[2]) / 400.0
    e, q, v = np.sqrt(sums[0]), np.sqrt(sums[1]), np.sqrt(sums[2])
    highest = tuning["forgetting"]
    if e <= tuning["level"] * v or e - v < 1e-12:
        return highest
    return max(min(q * v / (1e-12 + e - v), highest), 0.9)


@jit
def reset_on_alarm(tuning, state, scale, quiet):
    """
    Put P to a large value when the residual has grown.

    CUSUM of ε²/(σ²(1+ψᵀPψ)), each at most 16, for a variance four times what it was: F.
    Gustafsson, *Adaptive Filtering and Change Detection*, Wiley 2000, ch. 3.
    """
    square = min(state["epsilon"] ** 2 / (quiet * (1.0 + scale)), 16.0)
    sums, P = state["sums"], state["P"]
    sums[3] += 1.0
    state["sums"][0] = max(0.0, sums[0] + 0.375 * square - 0.693)
    if sums[0] > tuning["level"] and sums[3] > 200.0:
        sums[0] = 0.0
        sums[3] = 100.0  # half a second before the next
        for i in range(len(P)):
            for j in range(len(P)):
                P[i, j] = tuning["reset_P"][i, j]
