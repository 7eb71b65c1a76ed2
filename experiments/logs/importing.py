"""From a log in any of the formats to a record, with a report on what it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from flexaxis.estimators.models.axes import MODELS
from flexaxis.estimators.models.model import increment
from flexaxis.estimators.offline.frequency import information, line_spectrum
from flexaxis.experiments.logs.axis_file import Axis, output_of, usable
from flexaxis.experiments.logs.mapping import mapping_from, pick
from flexaxis.experiments.logs.plausibility import Check, examine, refuse_nonsense
from flexaxis.experiments.logs.prepare import check_time, prepare
from flexaxis.experiments.logs.readers import read_columns
from flexaxis.experiments.logs.spectrum import measured_response, rough_guess
from flexaxis.sim.errors import RecordError
from flexaxis.sim.record import Record, load_record

Array = NDArray[np.float64]

BURN_IN = 1.0  # s, where a log starts in the middle of a motion


@dataclass(frozen=True)
class Imported:
    """A record and what was looked at on the way."""

    record: Record
    checks: list[Check]


def import_log(
    path: Path,
    tables: Mapping[str, Any],
    *,
    resample: float | None = None,
    highpass: float | None = None,
    burn_in: float | None = None,
) -> Imported:
    """Read a log, check it and make a record of it.

    Parameters
    ----------
    path : Path
        CSV, MAT, HDF5 or NetCDF.
    tables : mapping
        As for `mapping_from`.
    resample, highpass : float, optional
        As for `prepare` [Hz].
    burn_in : float, optional
        Time from the start that is not to be fitted [s]; by default none for a log that starts
        at rest, as the estimators do, else a second, or a tenth of a short log.

    Raises
    ------
    LogError
        If the log cannot be used.
    """
    chosen = mapping_from(tables, source=str(path))
    raw = pick(read_columns(path), chosen)
    check_time(raw.time)
    refuse_nonsense(raw)
    found = prepare(raw, smooth=chosen.smooth, resample=resample, highpass=highpass)
    signals, valid, steps = found.signals, found.valid, None
    if "angle" in signals:
        steps = np.diff(signals["angle"], prepend=signals["angle"][0]) / found.period
        valid = valid & np.r_[True, valid[:-1]]  # an increment needs both of its ends
    moving = signals["speed"] if steps is None else steps
    if burn_in is None:
        resting = np.max(abs(moving[:5])) < 0.05 * np.std(moving)
        burn_in = 0.0 if resting else min(BURN_IN, 0.1 * len(moving) * found.period)
    record = Record(
        time=found.time,
        torque=signals["torque"],
        angle=signals.get("angle"),
        speed=signals.get("speed"),
        increment=steps,
        true_angle_a=signals.get("load_angle"),
        valid=None if valid.all() else valid,
        burn_in=burn_in,
        versions={
            "flexaxis": version("flexaxis"),
            "log": path.name,
            "torque": "smooth" if chosen.smooth else "held",
        },
    )
    return Imported(record, examine(raw, found))


def read_any(path: Path, tables: Mapping[str, Any], **options: float | None) -> Record:
    """Return a record from a record file, or import a log with the options of `import_log`."""
    if path.suffix == ".nc" and not tables and not any(v is not None for v in options.values()):
        try:
            return load_record(path)
        except RecordError as error:
            if path.is_file():
                raise RecordError(f"{error} To import it as a log, name its columns") from error
            raise
    return import_log(path, tables, **options).record


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
