"""What doubts are looked for in: a log on its even grid, its spectra, and how it was sampled."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.spectra import SEGMENT, Spectra, spectra

if TYPE_CHECKING:
    from flexaxis.experiments.logs.mapping import Raw
    from flexaxis.experiments.logs.prepare import Prepared
    from flexaxis.sim.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Evidence:
    """A log on its even grid, and as it was sampled.

    Attributes
    ----------
    record : Record
    raw : Raw
    prepared : Prepared
    """

    record: Record
    raw: Raw
    prepared: Prepared

    @property
    def period(self) -> float:
        """[s]."""
        return self.record.period

    @property
    def time(self) -> Array:
        """[s] (N,)."""
        return self.record.time

    @property
    def torque(self) -> Array:
        """Its means over [t_k, t_{k+1}) (N,)."""
        return self.record.torque

    @property
    def incremental(self) -> bool:
        """Whether the speed is a difference of angles, over the sample before."""
        return self.record.increment is not None or self.record.speed is None

    @cached_property
    def speed(self) -> Array:
        """Motor speed (N,) [rad/s]."""
        record = self.record
        found = record.speed if record.increment is None else record.increment
        if found is None:
            assert record.angle is not None  # a record has one of the three
            return np.diff(record.angle, prepend=record.angle[0]) / record.period
        return found

    @cached_property
    def usable(self) -> NDArray[np.bool_]:
        """Where nothing is missing (N,)."""
        valid = self.record.valid
        return np.ones(len(self.time), bool) if valid is None else valid

    def told(self, key: str) -> str:
        """Return what the record keeps of its import, such as ``torque``; or nothing."""
        return str(self.record.versions.get(key, ""))

    @property
    def smooth(self) -> bool:
        """Whether the torque was taken for a measured, smooth one."""
        return self.told("torque") == "smooth"

    @cached_property
    def spectra(self) -> Spectra:
        """Averaged spectra over pieces of 4 s, or half the log, of its longest run."""
        length = min(len(self.time) // 2, round(SEGMENT / self.period))
        edges = np.flatnonzero(np.diff(np.r_[False, self.usable, False].astype(int)))
        begin, end = max(edges.reshape(-1, 2).tolist(), key=lambda run: run[1] - run[0])
        run = slice(begin, end) if end - begin >= length else slice(None)
        return spectra(self.torque[run], self.speed[run], self.period, length=length)

    @cached_property
    def step_speed(self) -> Array:
        """Mean motor speed over [t_k, t_{k+1}), on which the torque k acts (N,) [rad/s]."""
        after = np.append(self.speed[1:], self.speed[-1])
        return after if self.incremental else (self.speed + after) / 2

    @cached_property
    def step_sign(self) -> Array:
        """Mean sign of the motor speed over [t_k, t_{k+1}), which turns over in between (N,)."""
        ends = self.speed
        if self.incremental:
            ends = (self.speed + np.append(self.speed[1:], self.speed[-1])) / 2
        after = np.append(ends[1:], ends[-1])
        size = np.abs(ends) + np.abs(after)
        return np.divide(ends + after, size, out=np.zeros_like(ends), where=size > 0)
