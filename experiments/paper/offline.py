"""Off-line identification, section 4: output error from several starts, and ARX models."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.arx import Arx, fit_arx
from flexaxis.estimators.offline.frequency import frequency_response
from flexaxis.estimators.offline.identification import Identified, output_error
from flexaxis.experiments.paper.data import Data, signals
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

NEAR = (1.2, 1.5)
FAR = (0.5, 0.7, 2.0)
LOW_ORDER, HIGH_ORDER = 10, 40
BAND = (40.0, 188.0)
"""Where the excitation reaches and Fig. 4 is compared [rad/s]."""


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
