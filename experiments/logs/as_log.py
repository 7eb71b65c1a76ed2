"""Write a record as a robot would log it: its units, its clock, its resolution, its gaps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from flexaxis.experiments.files import new_file
from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.units import SI, UNITS
from flexaxis.sim.errors import unknown
from flexaxis.sim.record import Record

LONGEST_GAP = 20  # samples


@dataclass(frozen=True)
class LogStyle:
    """How a robot writes its log.

    Attributes
    ----------
    units : tuple of str
        Such as ``("deg", "A")``: each is that of the signals that can have it, SI else.
    jitter : float
        Standard deviation of the time stamps [s]; the samples themselves are even.
    gaps : int
        Times at which up to `LONGEST_GAP` samples are missing.
    counts : int
        Counts of the encoder in a turn of the motor; 0 for the angle as it was measured.

    Raises
    ------
    LogError
        If a unit is unknown, or a size is below zero.
    """

    units: tuple[str, ...] = ()
    jitter: float = 0.0
    gaps: int = 0
    counts: int = 0

    def __post_init__(self) -> None:
        known = [unit for table in UNITS.values() for unit in table]
        for unit in self.units:
            if unit not in known:
                raise LogError(f"--units: {unknown('unit', unit, dict.fromkeys(known))}")
        if not min(self.jitter, self.gaps, self.counts) >= 0:
            raise LogError("--jitter, --gaps, --counts: give 0 or more")


def logged(record: Record, style: LogStyle, rng: np.random.Generator) -> pd.DataFrame:
    """Return the columns of a log in its own units, such as ``angle [deg]``, time first.

    Rows in gaps are left out, and signals that the record does not have.

    Parameters
    ----------
    record : Record
    style : LogStyle
    rng : Generator
        Of jitter and gaps.
    """
    time, angle = record.time, record.angle
    if style.counts and angle is not None:
        step = 2 * np.pi / style.counts
        angle = step * np.rint(angle / step)
    time = time + style.jitter * rng.standard_normal(len(time))
    kept = np.ones(len(time), bool) if record.valid is None else record.valid.copy()
    for begin in rng.integers(1, max(len(time) - LONGEST_GAP - 1, 2), style.gaps):
        # the first and the last sample stay
        kept[begin : min(begin + rng.integers(1, LONGEST_GAP + 1), len(time) - 1)] = False
    columns, signals = {}, (time, record.torque, angle, record.speed)
    for name, values in zip(SI, signals, strict=True):
        unit = next((unit for unit in style.units if unit in UNITS[name]), SI[name])
        if values is not None:
            columns[f"{name} [{unit}]"] = values[kept] / UNITS[name][unit]
    return pd.DataFrame(columns)


def write_log(path: Path, columns: pd.DataFrame) -> None:
    """Write columns as CSV."""
    with new_file(path) as part:
        columns.to_csv(part, index=False, float_format="%.10g")
