"""Write a record as a robot would log it: its units, its clock, its resolution, its gaps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.files import write_text
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.files import WRITTEN
from flexaxis.experiments.logs.units import UNITS
from flexaxis.sim.errors import unknown
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

LONGEST_GAP = 20  # samples
MOST_GAPS = 10_000

_SI = {"time": "s", "torque": "Nm", "angle": "rad", "speed": "rad/s"}


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
        for option in ("jitter", "gaps", "counts"):
            if not getattr(self, option) >= 0:
                raise LogError(f"--{option} {getattr(self, option)}: give 0 or more")
        if self.gaps > MOST_GAPS:
            raise LogError(f"--gaps {str(self.gaps)[:40]}: give at most {MOST_GAPS}")

    def unit(self, signal: str) -> str:
        """Return the unit of a signal."""
        return next((unit for unit in self.units if unit in UNITS[signal]), _SI[signal])


def logged(record: Record, style: LogStyle, rng: np.random.Generator) -> dict[str, Array]:
    """Return the columns (M,) of a log in its own units, time first; rows in gaps are left out.

    Parameters
    ----------
    record : Record
        What it does not have of the signals is left out.
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
        # the first and the last sample are there
        kept[begin : min(begin + rng.integers(1, LONGEST_GAP + 1), len(time) - 1)] = False
    found = {"time": time, "torque": record.torque, "angle": angle, "speed": record.speed}
    return {
        name: values[kept] / UNITS[name][style.unit(name)]
        for name, values in found.items()
        if values is not None
    }


def write_log(path: Path, columns: Mapping[str, Array], style: LogStyle) -> None:
    """Write columns as CSV; the file says whose it is, for `files.spare_foreign`.

    Parameters
    ----------
    path : Path
    columns : mapping of str to ndarray (M,)
        As from `logged`, and others in whatever unit their name says.
    style : LogStyle
        For units.
    """
    head = [f"{name} [{style.unit(name)}]" if name in UNITS else name for name in columns]
    lines = [f"# {WRITTEN}", ",".join(head)]
    row = ",".join(["%.10g"] * len(columns))
    lines += [row % cells for cells in zip(*(v.tolist() for v in columns.values()), strict=True)]
    write_text(path, "\n".join(lines) + "\n")
