"""The experiments of the paper: off-line identification, section 4, and recursive, section 5."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators import Rpem
from flexaxis.estimators.offline import priors
from flexaxis.estimators.offline.adaptation import steady_P
from flexaxis.estimators.offline.frequency import (
    Arx,
    fit_arx,
    frequency_response,
    information,
    line_spectrum,
)
from flexaxis.estimators.offline.identification import Identified, output_error
from flexaxis.experiments.paper.data import Data, signals
from flexaxis.experiments.scoring.pooling import settles, spread_at_a_time
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Adaptation = Mapping[str, Any]
"""What is chosen in the recursive method, as `Rpem` takes it: λ or Δ, and μ."""

NEAR = (1.2, 1.5)
FAR = (0.5, 0.7, 2.0)
LOW_ORDER, HIGH_ORDER = 10, 40
BAND = (40.0, 188.0)
"""Where the excitation reaches and Fig. 4 is compared [rad/s]."""

STRIDE = 20
"""Samples from one kept P to the next."""
COARSE = 200
"""The same where P does not matter: every look at it costs time."""
FORGETTING = 0.995
SLOW_FORGETTING = 0.999
SLOW_DRIFT = 1 / 16  # on Δ: a quarter of the speed
SPREAD_OVER = 10.0  # s at the end on which the standard deviation is taken


@dataclass(frozen=True)
class FilterRuns:
    """What an estimator did on S records of N samples.

    Attributes
    ----------
    adaptation : Adaptation
    P0 : ndarray (p,)
        Diagonal of P(0).
    theta : ndarray (S, N, p)
        Estimates over nominal.
    P : ndarray (S, N/stride, p)
        Diagonal of P(t+1|t), every so many samples.
    """

    adaptation: Adaptation
    P0: Array
    theta: Array
    P: Array


@dataclass(frozen=True)
class Convergence:
    """Both methods on the paper's experiment, and slower ones that test the theory.

    Attributes
    ----------
    Q : ndarray (p, p)
        E ψψᵀ of the reference torque at nominal parameters, eq. (31).
    runs : dict of str to FilterRuns
        By method. Those of `methods` from 1.2 times nominal; ``"slow forgetting"``, λ = 0.999, and
        ``"slow modification"``, Δ/16, over 60 s, from nominal.
    """

    Q: Array
    runs: Mapping[str, FilterRuns]


def filtered(
    data: Data,
    records: Sequence[Record],
    adaptation: Adaptation,
    *,
    P0: ArrayLike,
    start: float = 1.0,
    reset: tuple[int, Array] | None = None,
    stride: int = STRIDE,
) -> FilterRuns:
    """Run the recursive prediction-error method on each record.

    Parameters
    ----------
    data : Data
        For the model and what is identified.
    records : sequence of Record
    adaptation : Adaptation
    P0 : array_like (p,) or (p, p)
    start : float
        θ(0) over nominal.
    reset : (int, ndarray), optional
        Sample, a multiple of the stride, before which P is set to a new value.
    stride : int
        Samples from one kept P to the next.
    """
    nominal = data.parametrization.theta
    estimator = Rpem(
        data.model,
        identify=data.names,
        theta0=start * nominal,
        P0=P0,
        period=data.scenario.period,
        ceiling=np.inf,  # the paper has none
        **adaptation,
    )
    done = [_follow(estimator, record, reset, stride) for record in records]
    initial = np.asarray(P0, float)
    return FilterRuns(
        adaptation,
        P0=initial if initial.ndim == 1 else np.diag(initial),
        theta=np.stack([theta for theta, _ in done]) / nominal,
        P=np.stack([P for _, P in done]),
    )


def _follow(
    estimator: Rpem, record: Record, reset: tuple[int, Array] | None, stride: int
) -> tuple[Array, Array]:
    estimator.reset()
    (u, y), theta, P = signals(record), [], []
    for k in range(0, len(u), stride):
        if reset and k == reset[0]:
            estimator.P = reset[1]
        theta.append(estimator.run(u[k : k + stride], y[k : k + stride]))
        P.append(np.diag(estimator.P))
    return np.concatenate(theta), np.array(P)


def drift() -> Array:
    """Return the diagonal of Δ (p,), eq. (32)."""
    return np.array(list(priors.DRIFT.values()))


def methods() -> dict[str, Adaptation]:
    """Return the two methods of the paper: its λ, and Δ of eq. (32)."""
    return {"forgetting": {"forgetting": FORGETTING}, "modification": {"drift": drift()}}


def converge(data: Data) -> Convergence:
    """Run the experiments of section 5 on the data."""
    lines = line_spectrum(steady(data, data.reference_torque), period=data.scenario.period)
    model = data.parametrization
    Q = information(model, model.theta, *lines, period=data.scenario.period)
    slow: dict[str, Adaptation] = {
        "slow forgetting": {"forgetting": SLOW_FORGETTING},
        "slow modification": {"drift": SLOW_DRIFT * drift()},
    }
    runs = {name: _paper(data, adaptation) for name, adaptation in methods().items()}
    runs |= {
        name: filtered(data, data.long, adaptation, P0=steady_P(Q, **adaptation))
        for name, adaptation in slow.items()
    }
    return Convergence(Q, runs)


def steady(data: Data, signal: Array) -> Array:
    """Return the last two periods of a signal (N,), where no transient is left."""
    return signal[-2 * round(data.excitation.period / data.scenario.period) :]


def _paper(data: Data, adaptation: Adaptation) -> FilterRuns:
    P0 = priors.nominal_P(
        data.model,
        data.reference_torque,
        identify=data.names,
        period=data.scenario.period,
        **adaptation,
    )
    return filtered(data, data.nominal, adaptation, P0=P0, start=data.scenario.start)


def times(data: Data, runs: FilterRuns, level: float) -> dict[str, float]:
    """Return when the median run has all but `level` of the initial error behind it [s]."""
    scenario = data.scenario
    error = (runs.theta - 1) / (scenario.start - 1)
    found = (settles(list(error[:, :, i]), level, scenario.period) for i in range(len(data.names)))
    return {
        name: np.inf if time is None else time for name, time in zip(data.names, found, strict=True)
    }


def mean_P(runs: FilterRuns) -> Array:
    """Return the mean of diag P (S, p) of each run over its second half, without the transient."""
    return runs.P[:, runs.P.shape[1] // 2 :].mean(axis=1)


def pooled_std(data: Data, runs: FilterRuns) -> Array:
    """Return the standard deviation of the estimates (p,) over the runs, in % of nominal.

    It is that at one time across runs, pooled over the last 10 s: an estimate that moves as slowly
    as k_T does under Δ of (32) would hide in the mean over a window of its own run.
    """
    return 100 * spread_at_a_time(runs.theta[:, -round(SPREAD_OVER / data.scenario.period) :])


@dataclass(frozen=True)
class Offline:
    """Everything that was identified off line.

    Attributes
    ----------
    runs : list of Identified
        The three parameters from 1.2 times nominal, on each record.
    starts : dict of float to Identified
        On the first record, by the start over nominal.
    physical : Identified
        All parameters but r and k_T, which sets the scale.
    everything : Identified
        All parameters but r.
    arx : dict of int to Arx
        By the order.
    """

    runs: list[Identified]
    starts: dict[float, Identified]
    physical: Identified
    everything: Identified
    arx: dict[int, Arx]


def identify_offline(data: Data) -> Offline:
    """Identify from the records of 60 s."""
    first = data.long[0]
    u, y = signals(first)
    free = tuple(name for name in data.model.parameters if name != "r")
    runs = [_from(data, record, data.names, NEAR[0]) for record in data.long]
    return Offline(
        runs=runs,
        starts={NEAR[0]: runs[0]}
        | {start: _from(data, first, data.names, start) for start in (*NEAR[1:], *FAR)},
        physical=_from(data, first, free[1:], NEAR[0]),
        everything=_from(data, first, free, 1.0),
        arx={
            order: fit_arx(u, y, order=order, period=first.period)
            for order in (LOW_ORDER, 20, 30, HIGH_ORDER)
        },
    )


def _from(data: Data, record: Record, names: tuple[str, ...], start: float) -> Identified:
    return output_error(
        data.model,
        *signals(record),
        identify=names,
        start=start * data.model.parametrize(names).theta,
        period=record.period,
        max_evaluations=30,
    )


def decibels(response: NDArray[np.complex128]) -> Array:
    """Return the magnitude [dB]."""
    return 20 * np.log10(np.abs(response))


def magnitude_error(data: Data, response: NDArray[np.complex128], omega: Array) -> float:
    """Return the largest deviation from the true magnitude over some frequencies [dB]."""
    model = data.parametrization
    truth, _ = frequency_response(model, model.theta, omega, period=data.scenario.period)
    return float(np.max(np.abs(decibels(response) - decibels(truth))))


def band() -> Array:
    """Return frequencies (400,) over the band of comparison [rad/s]."""
    return np.linspace(*BAND, 400)
