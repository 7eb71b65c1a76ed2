"""What we add where the paper leaves a question for further work.

A check is a function of the evidence: to add a claim, write one more.
"""

# ruff: noqa: D401  (the first line of a docstring is the claim)

from __future__ import annotations

import numpy as np

from flexaxis.experiments.paper.claims import Decided, Evidence, by_name, check
from flexaxis.experiments.paper.further_work import DriftChoice, Windup

SLOW = 1.2
"""Wanted time constant from which on the plant's memory no longer matters [s]."""


def _slow(designs: list[DriftChoice]) -> list[DriftChoice]:
    return [design for design in designs if design.wanted.min() >= SLOW]


def _ratios(e: Evidence, designs: list[DriftChoice]) -> dict[str, float]:
    """Return measured over wanted time constants, the worst of several designs."""
    ratios = np.array([design.measured / design.wanted for design in designs])
    worst = np.argmax(np.abs(np.log(ratios)), axis=0)
    return by_name(e.data.names, ratios[worst, np.arange(ratios.shape[1])])


@check("section 5.3, choice of Δ left open", "t63 over wanted within 1/1.4 … 1.4 from 1.2 s on")
def drift_from_time_constants(e: Evidence) -> Decided:
    """Δ_ii = 1/(τ_i² Q_ii) gives each estimate the time constant that is wanted."""
    ratios = _ratios(e, _slow(e.further.diagonal))
    return ratios, all(1 / 1.4 <= ratio <= 1.4 for ratio in ratios.values())


@check("section 5.3, choice of Δ left open", "t63 [s] within 1/1.4 … 1.4 of 2.4, 1.2 and 0.6 s")
def time_constants_one_by_one(e: Evidence) -> Decided:
    """The time constants of the parameters can be chosen one by one."""
    design = e.further.apart
    ratio = design.measured / design.wanted
    return by_name(e.data.names, design.measured), bool(np.all((ratio > 1 / 1.4) & (ratio < 1.4)))


@check("section 5.3, choice of Δ left open", "standard deviation over predicted within 20 % of one")
def variance_of_the_choice(e: Evidence) -> Decided:
    """The variance that a time constant costs is predicted by σ² P/2 with P of eq. (30)."""
    slow = _slow(e.further.diagonal)
    ratios = np.mean([design.measured_std / design.predicted_std for design in slow], axis=0)
    return by_name(e.data.names, ratios), bool(np.all(np.abs(ratios - 1) <= 0.2))


def unregularised(studies: list[Windup]) -> Windup:
    """Return the study without regularisation."""
    return next(study for study in studies if study.mu == 0)


def regularised(studies: list[Windup], mu: float = 1.0) -> Windup:
    """Return the study with some μ."""
    return next(study for study in studies if study.mu == mu)


def price(studies: list[Windup], study: Windup) -> float:
    """Return the lag after a fault over that without μ, for the parameter that pays most."""
    without = unregularised(studies).lag
    return max(study.lag[name] / without[name] for name in without)


@check("section 5.3, regularisation left open", "burst [%] of θ̂ over 100 without, below 20 with")
def regularisation_stops_the_burst(e: Evidence) -> Decided:
    """μ = 1 stops the burst of the estimates when the excitation returns after a standstill."""
    studies = e.further.forgetting
    burst = {"μ = 0": unregularised(studies).burst, "μ = 1": regularised(studies).burst}
    return burst, burst["μ = 0"] > 100 and burst["μ = 1"] < 20


@check("section 5.3, regularisation left open", "lag after a fault over that with μ = 0, ≤ 1.15")
def regularisation_costs_little(e: Evidence) -> Decided:
    """μ = 1 makes the estimates hardly slower where the axis moves."""
    ratios = {
        "forgetting": price(e.further.forgetting, regularised(e.further.forgetting)),
        "modification": price(e.further.drift, regularised(e.further.drift)),
    }
    return ratios, max(ratios.values()) <= 1.15


def resets(e: Evidence) -> dict[float | None, dict[str, float]]:
    """Return the lags by the prior deviation that P was reset to."""
    return {study.fraction: study.lag for study in e.further.resets}


@check("section 5.2, change detection left open", "lag without over with reset ≥ 1.5 for each")
def reset_shortens_the_lag(e: Evidence) -> Decided:
    """Resetting P to a prior of 3 % at a known change makes the estimates follow faster."""
    lag = resets(e)
    gain = {name: lag[None][name] / lag[0.03][name] for name in e.data.names}
    return gain, min(gain.values()) >= 1.5


@check("section 5.2, change detection left open", "lag with 100 % over that with 3 %: > 3 for one")
def reset_can_be_too_large(e: Evidence) -> Decided:
    """A reset to a prior of 100 % throws estimates off before they settle."""
    lag = resets(e)
    loss = {name: lag[1.0][name] / lag[0.03][name] for name in e.data.names}
    return loss, max(loss.values()) > 3
