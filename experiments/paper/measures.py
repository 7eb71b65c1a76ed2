"""What the claims are decided on: numbers of the evidence, one or one for each parameter."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import find_peaks

from flexaxis.estimators.offline.frequency import fit_arx, frequency_response
from flexaxis.estimators.offline.priors import drift_for, estimate_covariance
from flexaxis.experiments.paper.evidence import (
    FORGETTING,
    METHODS,
    PAUSE,
    Adaptation,
    Evidence,
    Runs,
    signals,
)
from flexaxis.experiments.scoring.parameter_names import true_theta
from flexaxis.experiments.scoring.scores import lag, settling

Array = NDArray[np.float64]
ByName = Mapping[str, Any]

PHYSICAL = "physical model, identified"
BAND = (40.0, 188.0)
"""Where the excitation reaches and Fig. 4 is compared [rad/s]."""
ORDERS = (10, 30, 40)
"""Of the ARX models."""
MU = (0.1, 1.0, 10.0)
"""Values of μ of eq. (12) with which P(0) lies below the bound on P."""
WINDOW = 1000
"""Samples after a fault or a standstill."""
LAST = 2000
"""Samples at the end over which a standard deviation is taken."""


def prediction_error(e: Evidence) -> Any:
    """Return the error of ŷ at the true parameters, without noise, over the rms of the speed."""
    record = e.records("nominal")[0]
    return np.std(e.predict(record.torque)[0] - record.true_speed) / np.std(record.true_speed)


def torque_lines(e: Evidence) -> tuple[Array, Array]:
    """Return frequency [rad/s] and amplitude [N m] of the lines of the torque, first run."""
    omega, power = e.lines(e.records("nominal")[0].torque)
    last = round(2 * e.excitation.high * e.excitation.period)
    lines = slice(2, last + 1, 2)  # of two periods every second DFT line is one
    return omega[lines], np.sqrt(2 * power[lines])


def torque_peaks(e: Evidence) -> ByName:
    """Return the peaks of the torque's spectrum [rad/s]; the edge of the band can be one."""
    omega, amplitude = torque_lines(e)
    peaks, _ = find_peaks(np.r_[0, amplitude, 0])
    return {f"peak {i}": w for i, w in enumerate(omega[peaks - 1], 1)}


def low_energy(e: Evidence) -> Any:
    """Return the share of the torque's energy below 70 rad/s [%]."""
    omega, amplitude = torque_lines(e)
    return 100 * np.sum(amplitude[omega < 70] ** 2) / np.sum(amplitude**2)


def power_over_spectrum(e: Evidence) -> Array:
    """Return the mean of ψ² over the integral of |G_θ|² over the spectrum, the worst run's."""
    ratios = []
    for record in e.records("nominal"):
        power = np.mean(e.steady(e.predict(record.torque)[1]) ** 2, axis=0)
        ratios.append(power / np.diag(e.information(record.torque)))
    return worst(ratios)


def worst(ratios: ArrayLike) -> Array:
    """Return of each column (S, p) the ratio that is farthest from one, or its inverse: ≥ 1."""
    return np.exp(np.abs(np.log(ratios)).max(axis=0))


def offline_error(e: Evidence) -> Array:
    """Return the largest error of off-line identification in any run [% of nominal]."""
    return 100 * np.max([np.abs(run.theta / e.model.theta - 1) for run in e.offline], axis=0)


def offline_deviations(e: Evidence) -> Array:
    """Return the off-line errors (S, p) over the standard deviations claimed with them."""
    return np.abs([(r.theta - e.model.theta) / r.standard_deviations for r in e.offline])


def near_starts(e: Evidence) -> ByName:
    """Return the largest difference of what is found from 1.2 and from 1.5, and the warnings."""
    near, other = e.offline[0], e.identified(e.names, 1.5)
    difference = np.abs(near.theta / other.theta - 1).max()
    return {"difference": difference, "warnings": len((*near.warnings, *other.warnings))}


def far_starts(e: Evidence) -> ByName:
    """Return the correlation of the residual by the start; 0 without the warning."""
    runs = {f"{start:g}×": e.identified(e.names, start) for start in (0.5, 0.7, 2.0)}
    return {n: r.correlation * ("local minimum" in " ".join(r.warnings)) for n, r in runs.items()}


def free_scale(e: Evidence) -> ByName:
    """Return the condition with all parameters free, and how many of them no warning names."""
    run = e.identified(e.all_but("r"), 1.0)
    warned = " ".join(run.warnings)
    return {"condition": run.condition, "unnamed": sum(n not in warned for n in run.names)}


def responses(e: Evidence, omega: Array) -> dict[str, NDArray[np.complex128]]:
    """Return the frequency responses (M,) of the axis, and of the models of Fig. 4."""
    u, y = signals(e.records("long")[0])
    result = {f"ARX, order {n}": fit_arx(u, y, order=n, period=e.period).response(omega)
             for n in ORDERS}  # fmt: skip
    for name, names, theta in (
        ("axis", e.names, e.model.theta), (PHYSICAL, e.physical.names, e.physical.theta)
    ):  # fmt: skip
        model = e.axis.parametrize(names)
        result[name], _ = frequency_response(model, theta, omega, period=e.period)
    return result


def magnitude_error(e: Evidence, *names: str) -> ByName:
    """Return the largest error of the magnitude of models in the band [dB]."""
    result = responses(e, np.linspace(*BAND, 400))
    return {name: np.abs(decibels(result[name] / result["axis"])).max() for name in names}


def decibels(response: Any) -> Any:
    """Return the magnitude [dB]."""
    return 20 * np.log10(np.abs(response))


def final_error(e: Evidence) -> Array:
    """Return the error of the last estimates with forgetting (S, p) [% of nominal]."""
    return 100 * np.abs(e.runs("forgetting").theta[:, -1] - 1)


def times(e: Evidence, method: str, level: float) -> Array:
    """Return when the median run has all but `level` of the initial error behind it (p,) [s]."""
    error = np.median((e.runs(method).theta - 1) / (e.scenario.start - 1), axis=0)
    return np.array([settling(column, level, e.period) for column in error.T], float)


def mean_P(e: Evidence, method: str) -> Array:
    """Return the mean of diag P (p,) over the second half of all runs."""
    P = e.runs(method).P
    return P[:, P.shape[1] // 2 :].mean(axis=(0, 1))


def recipe_over_mean(e: Evidence) -> Array:
    """Return P(0) of the recipe over the mean of diag P, the worse of both methods."""
    return worst([e.recipe(method) / mean_P(e, method) for method in METHODS])


def times_of_k_T(e: Evidence) -> ByName:
    """Return t63 of k_T with both methods [s]."""
    return {method: times(e, method, 0.37)[0] for method in METHODS}


def std(runs: Runs) -> Array:
    """Return the standard deviation of the estimates (p,) over the runs, over nominal.

    It is that at one time across runs, pooled over the last 10 s: an estimate that moves as slowly
    as k_T does under Δ of (32) would hide in the mean over a window of its own run.
    """
    return np.sqrt(np.var(runs.theta[:, -LAST:], axis=0, ddof=1).mean(axis=0))


def stds(e: Evidence, name: str) -> ByName:
    """Return the standard deviation of an estimate with both methods [% of nominal]."""
    return {m: 100 * std(e.runs(m))[e.names.index(name)] for m in METHODS}


def over_theory(e: Evidence, method: str) -> Array:
    """Return diag P over that of eq. (29) or (30)."""
    return mean_P(e, method) / np.diag(e.steady_P(e.adaptations[method]))


def claimed(e: Evidence, P: Array) -> Array:
    """Return the standard deviation √(σ² P/2) (p,) that P (p, p) claims, over nominal."""
    return np.sqrt(np.diag(estimate_covariance(P, e.scenario.noise.speed**2))) / e.model.theta


def std_over_claim(e: Evidence, method: str) -> Array:
    """Return the standard deviation seen over that claimed with the mean of diag P."""
    return std(e.runs(method)) / claimed(e, np.diag(mean_P(e, method)))


@cache
def standstill(e: Evidence, method: str, mu: float) -> Runs:
    """Return the runs with a standstill of 20 s, with a method and μ."""
    return e.filtered("pause", e.adaptations[method], mu=mu)


def peaks_over_bounds(e: Evidence, method: str) -> ByName:
    """Return the largest P in a standstill over its bound, by μ.

    The bound of P_ii is (1−λ)/μ with forgetting, and √(Δ_ii/μ) with covariance modification.
    """
    result = {}
    for mu in MU:
        bound = (1 - FORGETTING) / mu if method == "forgetting" else np.sqrt(e.drift / mu)
        result[f"μ = {mu:g}"] = np.max(standstill(e, method, mu).P / bound)
    return result


def growth(e: Evidence) -> Any:
    """Return by how much P grows in a standstill without μ."""
    P = standstill(e, "forgetting", 0.0).P
    return P.max() / P[:, 0].max()


def bursts(e: Evidence) -> ByName:
    """Return the largest error after a standstill, without μ and with μ = 1 [%], median run."""
    restart, result = round(PAUSE[1] / e.period), {}
    for mu in (0.0, 1.0):
        theta = standstill(e, "forgetting", mu).theta[:, restart : restart + WINDOW]
        result[f"μ = {mu:g}"] = 100 * np.median(np.abs(theta - 1).max(axis=(1, 2)))
    return result


def steps(e: Evidence, kind: str, adaptation: Adaptation, mu: float = 0.0) -> Iterator[Array]:
    """Yield θ̃/D (S, n) of each parameter, from the onset of its fault on."""
    for i, name in enumerate(e.names):
        runs, record = e.filtered(kind + name, adaptation, mu=mu), e.records(kind + name)[0]
        theta = true_theta(e.names, record.true_parameters) / e.model.theta
        before, *after = theta[e.onset - 1 :, i]
        yield (runs.theta[:, e.onset :, i] - after) / abs(after[0] - before)


def lags(e: Evidence, method: str, mu: float = 0.0) -> Array:
    """Return the mean lag after a fault of each parameter (p,) [s]."""
    errors = steps(e, "", e.adaptations[method], mu)
    return np.array([lag(error[:, :WINDOW].T, e.period).mean() for error in errors])


def prices(e: Evidence) -> ByName:
    """Return the lag with μ = 1 over that without, for the parameter that pays most."""
    return {method: np.max(lags(e, method, 1.0) / lags(e, method)) for method in METHODS}


@cache
def choice(e: Evidence, *targets: float) -> tuple[Array, Array]:
    """Return what a Δ chosen for time constants [s] does, (p,) each.

    These are the time of 63 % of a small step over that wanted, and the standard deviation without
    a change over that predicted.
    """
    chosen = {"drift": drift_for(targets, e.Q, period=e.period)}
    errors = steps(e, "small ", chosen)
    t63 = [settling(np.median(error, axis=0), 0.37, e.period) for error in errors]
    runs = e.filtered("nominal", chosen)
    return np.array(t63, float) / targets, std(runs) / claimed(e, e.steady_P(chosen))


def choices(e: Evidence) -> list[tuple[Array, Array]]:
    """Return `choice` for time constants that exceed the memory of the plant."""
    return [choice(e, *3 * [tau]) for tau in (1.2, 2.4)]
