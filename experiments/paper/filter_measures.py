"""What claims on section 5 are decided on: convergence, P, variance, regularisation, and more."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.adaptation import estimate_covariance, steady_P
from flexaxis.experiments.paper.claim import Evidence, by_name
from flexaxis.experiments.paper.experiments import (
    FORGETTING,
    drift,
    mean_P,
    methods,
    pooled_std,
    times,
)
from flexaxis.experiments.paper.further_work import DriftChoice, Windups
from flexaxis.experiments.paper.model_measures import ByName, worst

Array = NDArray[np.float64]

SLOW = 1.2
"""Wanted time constant from which on the plant's memory no longer matters [s]."""


def final_error(e: Evidence) -> Array:
    """Return the error of the last estimates with forgetting (S, p) [% of nominal]."""
    return 100 * np.abs(e.convergence.runs["forgetting"].theta[:, -1] - 1)


def middle_error(e: Evidence) -> Array:
    """Return its median over the runs."""
    return np.median(final_error(e), axis=0)


def largest_error(e: Evidence) -> Array:
    """Return its largest in any run."""
    return final_error(e).max(axis=0)


def magnitudes(e: Evidence, method: str) -> Array:
    """Return the mean of diag P."""
    return mean_P(e.convergence.runs[method]).mean(axis=0)


def recipe_over_mean(e: Evidence) -> ByName:
    """Return P(0) of the recipe over the mean of diag P, by method and parameter."""
    ratios = {m: (runs := e.convergence.runs[m]).P0 / mean_P(runs).mean(axis=0) for m in methods()}
    return {f"{m} {name}": r for m, each in ratios.items() for name, r in by_name(e, each).items()}


def first_63_percent(e: Evidence) -> ByName:
    """Return t63 of k_T with both methods [s]."""
    return {m: times(e.data, e.convergence.runs[m], 0.37)["k_T"] for m in methods()}


def std_of(e: Evidence, name: str) -> ByName:
    """Return the standard deviation of an estimate with both methods [% of nominal]."""
    i = e.data.names.index(name)
    return {m: float(pooled_std(e.data, e.convergence.runs[m])[i]) for m in methods()}


def over_theory(e: Evidence, method: str) -> Array:
    """Return diag P over that of eq. (29) or (30), for the median run."""
    runs = e.convergence.runs[method]
    theory = np.diag(steady_P(e.convergence.Q, **runs.adaptation))
    return np.median(mean_P(runs), axis=0) / theory


def deviation_over_claim(e: Evidence, method: str) -> Array:
    """Return the standard deviation seen over the √(σ² P/2) claimed, by parameter."""
    runs = e.convergence.runs[method]
    P = np.diag(mean_P(runs).mean(axis=0))
    variance = np.diag(estimate_covariance(P, e.data.scenario.noise.speed**2))
    claimed = 100 * np.sqrt(variance) / e.data.parametrization.theta
    return pooled_std(e.data, runs) / claimed


def peak_over_bound(e: Evidence) -> ByName:
    """Return the largest P in a standstill over (1−λ)/μ, by μ with which P(0) lies below that."""
    return {
        f"μ = {mu:g}": s.peak * mu / (1 - FORGETTING)
        for mu, s in e.further.windups["forgetting"].items()
        if mu > 0 and s.runs.P0.max() < (1 - FORGETTING) / mu
    }


def peaks_over_bounds(e: Evidence) -> ByName:
    """Return the largest P_ii in a standstill over √(Δ_ii/μ), by μ with which P(0) lies below."""
    return {
        f"μ = {mu:g}": float(np.max(study.runs.P / bound))
        for mu, study in e.further.windups["modification"].items()
        if mu > 0 and np.all((bound := np.sqrt(drift() / mu)) > study.runs.P0)
    }


def growth(e: Evidence) -> float:
    """Return by how much P grows in a standstill without μ."""
    study = e.further.windups["forgetting"][0.0]
    return study.peak / float(study.runs.P0.max())


def _slow(e: Evidence) -> list[DriftChoice]:
    return [design for design in e.further.diagonal if design.wanted.min() >= SLOW]


def time_constants(e: Evidence) -> Array:
    """Return measured over wanted time constants, the worst of several designs."""
    return worst(np.array([d.measured / d.wanted for d in _slow(e)]))


def apart(e: Evidence) -> Array:
    """Return measured over wanted time constants, where each is another one."""
    return e.further.apart.measured / e.further.apart.wanted


def std_of_the_choice(e: Evidence) -> Array:
    """Return the standard deviation over that predicted, the mean of several designs."""
    ratios = [design.measured_std / design.predicted_std for design in _slow(e)]
    return np.mean(ratios, axis=0)


def bursts(e: Evidence) -> ByName:
    """Return the largest error after a standstill, without μ and with μ = 1 [%]."""
    return {f"μ = {mu:g}": e.further.windups["forgetting"][mu].burst for mu in (0.0, 1.0)}


def price(studies: Windups, mu: float) -> float:
    """Return the lag after a fault over that without μ, for the parameter that pays most."""
    return max(studies[mu].lag[name] / without for name, without in studies[0.0].lag.items())


def prices(e: Evidence) -> ByName:
    """Return the price of μ = 1 with both methods."""
    return {method: price(studies, 1.0) for method, studies in e.further.windups.items()}


def lag_over(e: Evidence, fraction: float | None) -> ByName:
    """Return the lag with P reset to a prior, or not reset, over that with a prior of 3 %."""
    resets = e.further.resets
    return {n: resets[fraction].lag[n] / resets[0.03].lag[n] for n in e.data.names}
