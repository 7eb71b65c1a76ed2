"""What the paper left for further work: choosing Δ, regularisation, and P(0) after a change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.adaptation import drift_for, estimate_covariance, steady_P
from flexaxis.experiments.paper.data import PAUSE, Data
from flexaxis.experiments.paper.experiments import (
    COARSE,
    FORGETTING,
    Adaptation,
    FilterRuns,
    filtered,
    methods,
    pooled_std,
)
from flexaxis.experiments.scoring.parameter_names import true_theta
from flexaxis.experiments.scoring.pooling import settles
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

WANTED = (0.3, 0.6, 1.2, 2.4)
"""Time constants asked of all parameters [s]."""

APART = (2.4, 1.2, 0.6)
"""Time constants asked of k_T, 1/J_a and f_m one by one [s]."""

MU = (0.0, 1e-3, 1e-2, 1e-1, 0.3, 1.0, 10.0, 100.0, 1000.0)
"""Values of μ of eq. (11); 0.3 is recommended for the nominal axis in stop-and-go operation."""

RESETS = (0.03, 1.0)
"""Prior standard deviation after a change, as a fraction of each parameter."""

WINDOW = 5.0  # s after a change


@dataclass(frozen=True)
class DriftChoice:
    """Δ for wanted time constants: what the theory says, and what came out.

    Attributes
    ----------
    wanted : ndarray (p,)
        Time constants asked for [s].
    measured : ndarray (p,)
        Time of 63 % of a small step of each parameter [s].
    predicted_std, measured_std : ndarray (p,)
        Standard deviation without any change [% of nominal].
    """

    wanted: Array
    measured: Array
    predicted_std: Array
    measured_std: Array


@dataclass(frozen=True)
class Windup:
    """A standstill of 20 s with one μ.

    Attributes
    ----------
    runs : FilterRuns
    peak : float
        Largest diagonal element of P.
    burst : float
        Largest error of an estimate after the restart, in % of nominal; median over the runs.
    lag : dict of str to float
        Lag after a step fault of each parameter, without any standstill [s]: what μ costs.
    """

    runs: FilterRuns
    peak: float
    burst: float
    lag: dict[str, float]


Windups = Mapping[float, Windup]
"""Standstills by μ."""


@dataclass(frozen=True)
class Reset:
    """A reset of P at the known time of a step fault.

    Attributes
    ----------
    lag : dict of str to float
        By the parameter that changed [s].
    """

    lag: dict[str, float]


@dataclass(frozen=True)
class FurtherWork:
    """The three studies.

    Attributes
    ----------
    diagonal : list of DriftChoice
        For each of `WANTED`.
    apart : DriftChoice
    windups : dict of str to dict
        By method and μ.
    resets : dict of float to Reset
        By the prior standard deviation as a fraction of each parameter; None for no reset.
    """

    diagonal: list[DriftChoice]
    apart: DriftChoice
    windups: Mapping[str, Windups]
    resets: Mapping[float | None, Reset]


def further_work(data: Data, Q: Array) -> FurtherWork:
    """Run the three studies.

    Parameters
    ----------
    data : Data
    Q : ndarray (p, p)
        E ψψᵀ at nominal parameters.
    """
    return FurtherWork(
        diagonal=[choose_drift(data, Q, np.full(3, tau)) for tau in WANTED],
        apart=choose_drift(data, Q, np.array(APART)),
        windups={
            method: {mu: windup(data, Q, adaptation, mu) for mu in MU}
            for method, adaptation in methods().items()
        },
        resets={fraction: reset(data, Q, fraction) for fraction in (None, *RESETS)},
    )


def choose_drift(data: Data, Q: Array, wanted: Array) -> DriftChoice:
    """Choose Δ for wanted time constants (p,) [s], predict and measure what it does."""
    chosen: Adaptation = {"drift": drift_for(wanted, Q, period=data.scenario.period)}
    P = steady_P(Q, **chosen)
    variance = np.diag(estimate_covariance(P, data.scenario.noise.speed**2))
    return DriftChoice(
        wanted=wanted,
        measured=_steps(data, data.small, chosen, P),
        predicted_std=100 * np.sqrt(variance) / data.parametrization.theta,
        measured_std=pooled_std(data, filtered(data, data.nominal, chosen, P0=P, stride=COARSE)),
    )


def _steps(data: Data, faults: Mapping[str, list[Record]], chosen: Adaptation, P0: Array) -> Array:
    """Return when the median run has 63 % of a step of each parameter behind it (p,) [s]."""
    found = []
    for name, runs in _filtered(data, faults, chosen, P0).items():
        error = relative_error(data, runs, faults[name], name)
        settled = settles(list(error), 0.37, data.scenario.period)
        found.append(np.nan if settled is None else settled)
    return np.array(found)


def windup(data: Data, Q: Array, adaptation: Adaptation, mu: float) -> Windup:
    """Go through a standstill, and through step faults without one."""
    period = data.scenario.period
    P0, regular = steady_P(Q, **adaptation), {**adaptation, "regularization": mu}
    runs = filtered(data, data.pause, regular, P0=P0)
    restart = round(PAUSE[1] / period)
    after = np.abs(runs.theta[:, restart : restart + round(WINDOW / period)] - 1)
    return Windup(
        runs=runs,
        peak=float(runs.P.max()),
        burst=100 * float(np.median(after.max(axis=(1, 2)))),
        lag=lags(data, _filtered(data, data.faults, regular, P0)),
    )


def reset(data: Data, Q: Array, fraction: float | None) -> Reset:
    """Set P at the onset of each fault to the prior that a parameter may be off by a fraction."""
    noise = data.scenario.noise.speed**2
    # P is in units of the noise variance
    new = (fraction or 0) ** 2 * np.diag(data.parametrization.theta**2) / noise
    usual, at = {"forgetting": FORGETTING}, None if fraction is None else (data.onset, new)
    runs = _filtered(data, data.faults, usual, steady_P(Q, **usual), reset=at)
    return Reset(lag=lags(data, runs))


def _filtered(
    data: Data,
    faults: Mapping[str, list[Record]],
    adaptation: Adaptation,
    P0: Array,
    *,
    reset: tuple[int, Array] | None = None,
) -> dict[str, FilterRuns]:
    return {
        name: filtered(data, records, adaptation, P0=P0, reset=reset, stride=COARSE)
        for name, records in faults.items()
    }


def lags(data: Data, runs: Mapping[str, FilterRuns]) -> dict[str, float]:
    """Return the lag after each fault [s], the mean over its runs."""
    period = data.scenario.period
    window = round(WINDOW / period)
    found = {}
    for name in data.names:
        error = relative_error(data, runs[name], data.faults[name], name)[:, :window]
        found[name] = float(period * np.abs(error).sum(axis=1).mean())
    return found


def relative_error(data: Data, runs: FilterRuns, records: Sequence[Record], name: str) -> Array:
    """Return θ̃/D (S, n) of the parameter that changed, from the onset of the fault on."""
    i = data.names.index(name)
    parameters = records[0].true_parameters
    assert parameters is not None  # a simulated record knows the truth
    truth = true_theta(data.names, parameters)[:, i] / data.parametrization.theta[i]
    error = runs.theta[:, data.onset :, i] - truth[data.onset :]
    return error / abs(truth[data.onset] - truth[data.onset - 1])
