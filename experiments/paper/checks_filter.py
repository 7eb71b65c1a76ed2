"""Claims of the paper's section 5: convergence, P, variance, regularisation.

A check is a function of the evidence: to add a claim, write one more.
"""

# ruff: noqa: D401  (the first line of a docstring is the claim)

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.adaptation import estimate_covariance, steady_P
from flexaxis.experiments.paper.claims import Decided, Evidence, by_name, check
from flexaxis.experiments.paper.convergence import (
    FORGETTING,
    SLOW_DRIFT,
    SLOW_FORGETTING,
    drift,
    mean_P,
    pooled_std,
    times,
)
from flexaxis.experiments.paper.filters import FilterRuns
from flexaxis.experiments.paper.further_work import Windup

Array = NDArray[np.float64]


def settled_after(e: Evidence, runs: FilterRuns, level: float) -> dict[str, float]:
    """Return when the median run has all but `level` of the initial error behind it [s]."""
    scenario = e.data.scenario
    found = times(runs, level, start=scenario.start, period=scenario.period)
    return by_name(e.data.names, [np.inf if time is None else time for time in found])


def _final_error(e: Evidence) -> Array:
    """Return the error of the last estimates with forgetting (S, p) [% of nominal]."""
    return 100 * np.abs(e.convergence.forgetting.theta[:, -1] - 1)


@check("section 5.3, Fig. 6", "median of the final error < 0.5 % of nominal")
def forgetting_converges(e: Evidence) -> Decided:
    """With forgetting all estimates converge to their nominal values."""
    error = by_name(e.data.names, np.median(_final_error(e), axis=0))
    return error, max(error.values()) < 0.5


@check("section 5.3, Fig. 6", "final error < 1.5 % of nominal in every run")
def every_run_converges(e: Evidence) -> Decided:
    """With forgetting every single run converges."""
    error = by_name(e.data.names, _final_error(e).max(axis=0))
    return error, max(error.values()) < 1.5


@check("section 5.3, Fig. 6", "t63 [s] of k_T is the shortest")
def torque_constant_is_fastest(e: Evidence) -> Decided:
    """With forgetting the estimate of k_T converges at a somewhat higher rate."""
    t63 = settled_after(e, e.convergence.forgetting, 0.37)
    return t63, t63["k_T"] < min(t63["1/J_a"], t63["f_m"])


@check("section 5.3, Fig. 6", "t90 [s] of f_m over that of 1/J_a within 0.6 and 1.7")
def inertia_and_friction_alike(e: Evidence) -> Decided:
    """With forgetting the rate is about the same for J_a and f_m."""
    t90 = settled_after(e, e.convergence.forgetting, 0.10)
    return t90, 0.6 <= t90["f_m"] / t90["1/J_a"] <= 1.7


def _magnitudes(e: Evidence, runs: FilterRuns) -> dict[str, float]:
    return by_name(e.data.names, mean_P(runs).mean(axis=0))


@check("section 5.3, Fig. 7", "largest over smallest > 20")
def P_differs_with_forgetting(e: Evidence) -> Decided:
    """With forgetting the diagonal elements of P differ much in magnitude."""
    P = _magnitudes(e, e.convergence.forgetting)
    return P, max(P.values()) > 20 * min(P.values())


@check("section 5.3, Fig. 9, eq. (32)", "largest over smallest < 3")
def P_is_even_with_modification(e: Evidence) -> Decided:
    """With Δ = 1e-8 diag(5, 50, 500) the diagonal elements of P have the same magnitude."""
    P = _magnitudes(e, e.convergence.drift)
    return P, max(P.values()) < 3 * min(P.values())


@check("section 5.2", "P(0) over the mean of diag P in the second half within 15 % of one")
def recipe_gives_the_working_P(e: Evidence) -> Decided:
    """The update of P with ψ at nominal gives the P at which the filter then works."""
    ratios = {
        f"{label} {name}": float(ratio)
        for label, runs in (
            ("forgetting", e.convergence.forgetting),
            ("modification", e.convergence.drift),
        )
        for name, ratio in zip(e.data.names, runs.P0 / mean_P(runs).mean(axis=0), strict=True)
    }
    return ratios, all(abs(ratio - 1) <= 0.15 for ratio in ratios.values())


@check("section 5.3, Fig. 8", "t63 [s] of k_T at least twice that with forgetting")
def torque_constant_is_slower(e: Evidence) -> Decided:
    """With covariance modification the convergence rate of k_T is lower."""
    t63 = {
        "forgetting": settled_after(e, e.convergence.forgetting, 0.37)["k_T"],
        "modification": settled_after(e, e.convergence.drift, 0.37)["k_T"],
    }
    return t63, t63["modification"] > 2 * t63["forgetting"]


def std_of_both(e: Evidence, name: str) -> dict[str, float]:
    """Return the standard deviation of an estimate with both methods [% of nominal]."""
    i, period = e.data.names.index(name), e.data.scenario.period
    return {
        "forgetting": float(pooled_std(e.convergence.forgetting, period=period)[i]),
        "modification": float(pooled_std(e.convergence.drift, period=period)[i]),
    }


@check("section 5.3, Fig. 8", "standard deviation [%] of k_T below that with forgetting")
def torque_constant_is_quieter(e: Evidence) -> Decided:
    """With covariance modification the variance of k_T is lower."""
    std = std_of_both(e, "k_T")
    return std, std["modification"] < std["forgetting"]


@check("section 5.3, Fig. 8", "standard deviation [%] of f_m over 3 times that with forgetting")
def friction_is_noisier(e: Evidence) -> Decided:
    """With covariance modification the variance of f_m is much higher."""
    std = std_of_both(e, "f_m")
    return std, std["modification"] > 3 * std["forgetting"]


def _over_theory(e: Evidence, runs: FilterRuns, theory: Array) -> dict[str, float]:
    """Return diag P over that of the theory, for the median run."""
    return by_name(e.data.names, np.median(mean_P(runs), axis=0) / np.diag(theory))


def _within(ratios: dict[str, float], tolerance: float) -> bool:
    return all(abs(ratio - 1) <= tolerance for ratio in ratios.values())


@check("section 5.2, eq. (29)", "λ = 0.999: P over theory within 5 % of one")
def steady_P_with_slow_forgetting(e: Evidence) -> Decided:
    """For λ close to one P is (1−λ) Q⁻¹."""
    theory = steady_P(e.convergence.Q, forgetting=SLOW_FORGETTING)
    ratios = _over_theory(e, e.convergence.slow_forgetting, theory)
    return ratios, _within(ratios, 0.05)


@check("section 5.2, eq. (29)", "λ = 0.995: P over theory within 25 % of one")
def steady_P_with_forgetting(e: Evidence) -> Decided:
    """At the λ of the paper P is near (1−λ) Q⁻¹."""
    ratios = _over_theory(
        e, e.convergence.forgetting, steady_P(e.convergence.Q, forgetting=FORGETTING)
    )
    return ratios, _within(ratios, 0.25)


@check("section 5.2, eq. (30)", "Δ/16: P over theory within 15 % of one")
def steady_P_with_slow_modification(e: Evidence) -> Decided:
    """For a small Δ P solves P Q P = Δ."""
    theory = steady_P(e.convergence.Q, drift=SLOW_DRIFT * drift())
    ratios = _over_theory(e, e.convergence.slow_drift, theory)
    return ratios, _within(ratios, 0.15)


@check("section 5.2, eq. (30), (32)", "Δ of (32): P over theory within 30 % of one")
def steady_P_with_modification(e: Evidence) -> Decided:
    """At the Δ of the paper P nearly solves P Q P = Δ."""
    ratios = _over_theory(e, e.convergence.drift, steady_P(e.convergence.Q, drift=drift()))
    return ratios, _within(ratios, 0.3)


def _deviation_over_claim(e: Evidence, runs: FilterRuns) -> dict[str, float]:
    """Return the standard deviation seen over the √(σ² P/2) claimed, by parameter."""
    P = np.diag(mean_P(runs).mean(axis=0))
    variance = np.diag(estimate_covariance(P, e.data.scenario.noise.speed**2))
    claimed = 100 * np.sqrt(variance) / e.data.parametrization.theta
    seen = pooled_std(runs, period=e.data.scenario.period)
    return by_name(e.data.names, seen / claimed)


def half_of_P(ratios: dict[str, float], tolerance: float) -> bool:
    """Return whether deviations, given over those of σ²P/2, are these within a tolerance.

    On the whole they also have to lie nearer to them than to those of σ²P or σ²P/4, √2 away.
    """
    whole = float(np.mean(np.log2(list(ratios.values()))))
    return _within(ratios, tolerance) and abs(whole) < 0.25


@check(
    "section 5.2, with eq. (29)",
    "standard deviation over √(σ²P/2) within 30 % of one, the mean nearer to it than to √(σ²P)",
)
def variance_with_forgetting(e: Evidence) -> Decided:
    """With forgetting the variance of an estimate is σ² P/2."""
    ratios = _deviation_over_claim(e, e.convergence.forgetting)
    return ratios, half_of_P(ratios, 0.3)


@check(
    "section 5.2, with eq. (30)",
    "standard deviation over √(σ²P/2) within 40 % of one, the mean nearer to it than to √(σ²P)",
)
def variance_with_modification(e: Evidence) -> Decided:
    """With covariance modification, too, the variance of an estimate is σ² P/2."""
    ratios = _deviation_over_claim(e, e.convergence.drift)
    return ratios, half_of_P(ratios, 0.4)


def bounded(studies: list[Windup]) -> list[Windup]:
    """Return those with regularisation whose P(0) lies below (1−λ)/μ."""
    return [s for s in studies if s.mu > 0 and s.runs.P0.max() < (1 - FORGETTING) / s.mu]


@check(
    "section 3.1, eq. (9), (12)",
    "largest P in a standstill of 20 s, over (1−λ)/μ: ≤ 1, and within 2 % of it",
)
def regularisation_bounds_forgetting(e: Evidence) -> Decided:
    """With forgetting and regularisation P comes to (1−λ)/μ without excitation, and no higher."""
    ratios = {
        f"μ = {s.mu:g}": s.peak * s.mu / (1 - FORGETTING) for s in bounded(e.further.forgetting)
    }
    return ratios, len(ratios) >= 3 and min(ratios.values()) >= 0.98 and _never_above(ratios)


def _never_above(ratios: dict[str, float]) -> bool:
    return max(ratios.values()) <= 1 + 1e-9


@check(
    "section 3.1, eq. (10), (12)",
    "largest P_ii in a standstill of 20 s, over √(Δ_ii/μ): ≤ 1; for the largest μ ≥ 0.98",
)
def regularisation_bounds_modification(e: Evidence) -> Decided:
    """With covariance modification, regularisation keeps P_ii below √(Δ_ii/μ)."""
    ratios = {}
    for study in e.further.drift[1:]:
        bound = np.sqrt(drift() / study.mu)
        if np.all(bound > study.runs.P0):
            ratios[f"μ = {study.mu:g}"] = float(np.max(study.runs.P / bound))
    reached = list(ratios.values())[-1] >= 0.98  # a small μ takes longer than the standstill
    return ratios, len(ratios) >= 3 and reached and _never_above(ratios)


@check("section 3.1; section 5.3, last paragraph", "P grows more than 1e6-fold in 20 s")
def forgetting_winds_up(e: Evidence) -> Decided:
    """With forgetting and without regularisation P grows without bound at standstill."""
    study = e.further.forgetting[0]
    growth = study.peak / float(study.runs.P0.max())
    return growth, study.mu == 0 and growth > 1e6
