"""What the excitation of a record can tell of each parameter, before any estimator runs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from flexaxis.estimators.models.axes import MODELS
from flexaxis.estimators.models.model import increment
from flexaxis.estimators.offline.frequency import information, line_spectrum
from flexaxis.experiments.logs.axis_file import Axis, output_of, usable
from flexaxis.experiments.logs.spectrum import measured_response, rough_guess
from flexaxis.sim.record import Record

Array = NDArray[np.float64]


def expected_deviations(record: Record, axis: Axis) -> dict[str, float]:
    """Return what the excitation can tell of each parameter alone: its relative deviation.

    σ/(θ √(N E ψ²)), with E ψ² from the spectrum of the torque by eq. (28): before any estimator
    runs, and if all other parameters were known. σ is the noise of the output above the band of
    the excitation, spread over all frequencies: the least that it can be.

    Parameters
    ----------
    record : Record
    axis : Axis
        Its nominal values are where the gradient is taken; for a shipped model without
        values they are guessed from the log, where it has a way to.
    """
    output, period, ok = output_of(record), record.period, usable(record)
    y = np.asarray(getattr(record, output))[ok]
    if not axis.known and MODELS[axis.model.name].guess:
        guess = rough_guess(axis.model, measured_response(record.torque[ok], y, period=period))
        axis = axis.having(guess)
    model = increment(axis.model, period) if output == "increment" else axis.model
    chosen = model.parametrize(axis.model.parameters)
    omega, power = line_spectrum(record.torque[ok], period=period)
    lines = (power > 1e-9 * power.max()) & (omega > 0)
    Q = information(chosen, chosen.theta, omega[lines], power[lines], period=period)
    deviation = _noise(y, period) / np.sqrt(ok.sum() * np.diag(Q))
    return dict(zip(chosen.names, (deviation / abs(chosen.theta)).tolist(), strict=True))


def _noise(y: Array, period: float) -> float:
    """Return σ of the output from the frequencies where there is least of it."""
    _, power = welch(y, fs=1 / period, nperseg=min(len(y) // 2, 1024))
    return float(np.sqrt(np.percentile(power[1:], 20) / (2 * period)))
