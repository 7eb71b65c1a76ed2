"""The recursive experiments of the paper's section 5: forgetting, and covariance modification."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline import priors
from flexaxis.estimators.offline.adaptation import steady_P
from flexaxis.estimators.offline.frequency import information, line_spectrum
from flexaxis.experiments.paper.data import Data
from flexaxis.experiments.paper.filters import Adaptation, FilterRuns, filtered
from flexaxis.experiments.scoring.pools import settles, spread_at_a_time

Array = NDArray[np.float64]

FORGETTING = 0.995
SLOW_FORGETTING = 0.999
SLOW_DRIFT = 1 / 16  # on Δ: a quarter of the speed
SPREAD_OVER = 10.0  # s at the end on which the standard deviation is taken


@dataclass(frozen=True)
class Convergence:
    """Both methods on the paper's experiment, and slower ones that test the theory.

    Attributes
    ----------
    Q : ndarray (p, p)
        E ψψᵀ of the reference torque at nominal parameters, eq. (31).
    forgetting, drift : FilterRuns
        λ = 0.995, and Δ of eq. (32); from 1.2 times nominal.
    slow_forgetting, slow_drift : FilterRuns
        λ = 0.999, and Δ/16; 60 s, from nominal.
    """

    Q: Array
    forgetting: FilterRuns
    drift: FilterRuns
    slow_forgetting: FilterRuns
    slow_drift: FilterRuns


def drift() -> Array:
    """Return the diagonal of Δ (p,), eq. (32)."""
    return np.array(list(priors.DRIFT.values()))


def converge(data: Data) -> Convergence:
    """Run the experiments of section 5 on the data."""
    return Convergence(
        Q=reference_information(data),
        forgetting=_paper(data, Adaptation(forgetting=FORGETTING)),
        drift=_paper(data, Adaptation(drift=drift())),
        slow_forgetting=_slow(data, Adaptation(forgetting=SLOW_FORGETTING)),
        slow_drift=_slow(data, Adaptation(drift=SLOW_DRIFT * drift())),
    )


def reference_information(data: Data) -> Array:
    """Return E ψψᵀ (p, p) of the reference torque in its steady state."""
    lines = line_spectrum(steady(data, data.reference_torque), period=data.scenario.period)
    model = data.parametrization
    return information(model, model.theta, *lines, period=data.scenario.period)


def steady(data: Data, signal: Array) -> Array:
    """Return the last two periods of a signal (N,), where no transient is left."""
    return signal[-2 * round(data.excitation.period / data.scenario.period) :]


def _paper(data: Data, adaptation: Adaptation) -> FilterRuns:
    P0 = priors.nominal_P(
        data.model,
        data.reference_torque,
        identify=data.names,
        period=data.scenario.period,
        forgetting=adaptation.forgetting,
        drift=adaptation.drift,
    )
    return filtered(data, data.nominal, adaptation, P0=P0, start=data.scenario.start)


def _slow(data: Data, adaptation: Adaptation) -> FilterRuns:
    P = steady_P(
        reference_information(data), forgetting=adaptation.forgetting, drift=adaptation.drift
    )
    return filtered(data, data.long, adaptation, P0=P)


def times(runs: FilterRuns, level: float, *, start: float, period: float) -> list[float | None]:
    """Return when the median run has all but `level` of the initial error behind it [s], (p,)."""
    error = (runs.theta - 1) / (start - 1)
    return [settles(list(error[:, :, i]), level, period) for i in range(error.shape[2])]


def mean_P(runs: FilterRuns) -> Array:
    """Return the mean of diag P (S, p) of each run over its second half, without the transient."""
    return runs.P[:, runs.P.shape[1] // 2 :].mean(axis=1)


def pooled_std(runs: FilterRuns, *, period: float) -> Array:
    """Return the standard deviation of the estimates (p,) over the runs, in % of nominal.

    It is that at one time across runs, pooled over the last 10 s: an estimate that moves as slowly
    as k_T does under Δ of (32) would hide in the mean over a window of its own run.
    """
    end = runs.theta[:, -round(SPREAD_OVER / period) :]
    return 100 * spread_at_a_time(end)
