"""What claims on section 5 are decided on: convergence, P, variance, regularisation, and more."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.adaptation import estimate_covariance
from flexaxis.experiments.paper.claim import Evidence, by_name
from flexaxis.experiments.paper.experiments import (
    FORGETTING,
    FilterRuns,
    drift,
    mean_P,
    pooled_std,
    settled_P,
    times,
)
from flexaxis.experiments.paper.further_work import DriftChoice, Windup
from flexaxis.experiments.paper.model_measures import ByName, worst

Array = NDArray[np.float64]

SLOW = 1.2
"""Wanted time constant from which on the plant's memory no longer matters [s]."""


def forgetting(e: Evidence) -> FilterRuns:
    """Return the runs with the λ of the paper."""
    return e.convergence.forgetting


def modification(e: Evidence) -> FilterRuns:
    """Return the runs with the Δ of eq. (32)."""
    return e.convergence.drift


def final_error(e: Evidence) -> Array:
    """Return the error of the last estimates with forgetting (S, p) [% of nominal]."""
    return 100 * np.abs(forgetting(e).theta[:, -1] - 1)


def middle_error(e: Evidence) -> ByName:
    """Return its median over the runs."""
    return by_name(e, np.median(final_error(e), axis=0))


def largest_error(e: Evidence) -> ByName:
    """Return its largest in any run."""
    return by_name(e, final_error(e).max(axis=0))


def magnitudes(e: Evidence, runs: FilterRuns) -> ByName:
    """Return the mean of diag P."""
    return by_name(e, mean_P(runs).mean(axis=0))


def recipe_over_mean(e: Evidence) -> ByName:
    """Return P(0) of the recipe over the mean of diag P, by method and parameter."""
    methods = {"forgetting": forgetting(e), "modification": modification(e)}
    return {
        f"{label} {name}": ratio
        for label, runs in methods.items()
        for name, ratio in by_name(e, runs.P0 / mean_P(runs).mean(axis=0)).items()
    }


def first_63_percent(e: Evidence) -> ByName:
    """Return t63 of k_T with both methods [s]."""
    methods = {"forgetting": forgetting(e), "modification": modification(e)}
    return {label: times(e.data, runs, 0.37)["k_T"] for label, runs in methods.items()}


def std_of(e: Evidence, name: str) -> ByName:
    """Return the standard deviation of an estimate with both methods [% of nominal]."""
    methods = {"forgetting": forgetting(e), "modification": modification(e)}
    i = e.data.names.index(name)
    return {label: float(pooled_std(e.data, runs)[i]) for label, runs in methods.items()}


def over_theory(e: Evidence, runs: FilterRuns) -> ByName:
    """Return diag P over that of eq. (29) or (30), for the median run."""
    theory = np.diag(settled_P(e.convergence.Q, runs.adaptation))
    return by_name(e, np.median(mean_P(runs), axis=0) / theory)


def deviation_over_claim(e: Evidence, runs: FilterRuns) -> ByName:
    """Return the standard deviation seen over the √(σ² P/2) claimed, by parameter."""
    P = np.diag(mean_P(runs).mean(axis=0))
    variance = np.diag(estimate_covariance(P, e.data.scenario.noise.speed**2))
    claimed = 100 * np.sqrt(variance) / e.data.parametrization.theta
    return by_name(e, pooled_std(e.data, runs) / claimed)


def peak_over_bound(e: Evidence) -> ByName:
    """Return the largest P in a standstill over (1−λ)/μ, by μ with which P(0) lies below that."""
    return {
        f"μ = {s.mu:g}": s.peak * s.mu / (1 - FORGETTING)
        for s in e.further.forgetting
        if s.mu > 0 and s.runs.P0.max() < (1 - FORGETTING) / s.mu
    }


def peaks_over_bounds(e: Evidence) -> ByName:
    """Return the largest P_ii in a standstill over √(Δ_ii/μ), by μ with which P(0) lies below."""
    bounds = {s.mu: (s, np.sqrt(drift() / s.mu)) for s in e.further.drift if s.mu > 0}
    return {
        f"μ = {mu:g}": float(np.max(study.runs.P / bound))
        for mu, (study, bound) in bounds.items()
        if np.all(bound > study.runs.P0)
    }


def growth(e: Evidence) -> float:
    """Return by how much P grows in a standstill without μ."""
    study = with_mu(e.further.forgetting, 0.0)
    return study.peak / float(study.runs.P0.max())


def _slow(e: Evidence) -> list[DriftChoice]:
    return [design for design in e.further.diagonal if design.wanted.min() >= SLOW]


def time_constants(e: Evidence) -> ByName:
    """Return measured over wanted time constants, the worst of several designs."""
    return by_name(e, worst(np.array([d.measured / d.wanted for d in _slow(e)])))


def apart(e: Evidence) -> ByName:
    """Return measured over wanted time constants, where each is another one."""
    return by_name(e, e.further.apart.measured / e.further.apart.wanted)


def std_of_the_choice(e: Evidence) -> ByName:
    """Return the standard deviation over that predicted, the mean of several designs."""
    ratios = [design.measured_std / design.predicted_std for design in _slow(e)]
    return by_name(e, np.mean(ratios, axis=0))


def with_mu(studies: list[Windup], mu: float) -> Windup:
    """Return the study with some μ."""
    return next(study for study in studies if study.mu == mu)


def bursts(e: Evidence) -> ByName:
    """Return the largest error after a standstill, without μ and with μ = 1 [%]."""
    return {f"μ = {mu:g}": with_mu(e.further.forgetting, mu).burst for mu in (0.0, 1.0)}


def price(studies: list[Windup], study: Windup) -> float:
    """Return the lag after a fault over that without μ, for the parameter that pays most."""
    without = with_mu(studies, 0.0).lag
    return max(study.lag[name] / without[name] for name in without)


def prices(e: Evidence) -> ByName:
    """Return the price of μ = 1 with both methods."""
    studies = {"forgetting": e.further.forgetting, "modification": e.further.drift}
    return {label: price(each, with_mu(each, 1.0)) for label, each in studies.items()}


def lag_over(e: Evidence, fraction: float | None) -> ByName:
    """Return the lag with P reset to a prior, or not reset, over that with a prior of 3 %."""
    lag = {study.fraction: study.lag for study in e.further.resets}
    return {name: lag[fraction][name] / lag[0.03][name] for name in e.data.names}
