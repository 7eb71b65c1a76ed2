"""What doubts are looked for in: a log on its even grid, its spectra, and how it was sampled."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.signal import csd, welch

if TYPE_CHECKING:
    from flexaxis.experiments.logs.mapping import Raw
    from flexaxis.experiments.logs.prepare import Prepared
    from flexaxis.sim.record import Record

Array = NDArray[np.float64]

SEGMENT = 4.0  # s, of which spectra are averaged
EDGE = 0.01  # of the power of the torque that lies below its band, and above it


@dataclass(frozen=True)
class Spectra:
    """Averaged spectra of torque u and motor speed y.

    Attributes
    ----------
    frequency : ndarray (M,)
        [Hz].
    torque, speed : ndarray (M,)
        Power densities.
    cross : ndarray (M,) of complex
        From torque to speed.
    pieces : int
        Pieces of the log that do not overlap, over which they are averages.
    """

    frequency: Array
    torque: Array
    speed: Array
    cross: NDArray[np.complex128]
    pieces: int

    @property
    def coherence(self) -> Array:
        """Share of the speed that the torque explains (M,); 0 where there is neither."""
        both = self.torque * self.speed
        top = np.abs(self.cross) ** 2
        return np.divide(top, both, out=np.zeros_like(both), where=both > 0)


@dataclass(frozen=True)
class Evidence:
    """A log on its even grid, and where it is at hand, as it was sampled.

    Attributes
    ----------
    period : float
        [s].
    time : ndarray (N,)
        [s].
    torque : ndarray (N,)
        Its means over [t_k, t_{k+1}).
    speed : ndarray (N,)
        Motor speed [rad/s]: difference of angles over the sample before, or as measured.
    incremental : bool
        Whether the speed is such a difference.
    usable : ndarray (N,) of bool
        False where something is missing.
    smooth : bool
        Whether the torque was taken for a measured, smooth one.
    kind_because : str
        Why.
    highpass : float or None
        Corner of the filter that took drift away [Hz].
    angle : ndarray (N,) or None
        Motor angle [rad].
    raw : Raw or None
    prepared : Prepared or None
    """

    period: float
    time: Array
    torque: Array
    speed: Array
    incremental: bool
    usable: NDArray[np.bool_]
    smooth: bool
    kind_because: str = ""
    highpass: float | None = None
    angle: Array | None = None
    raw: Raw | None = None
    prepared: Prepared | None = None

    @property
    def still(self) -> bool:
        """Whether torque or motion are constant, so that there is nothing to see."""
        return not (np.ptp(self.torque[self.usable]) and np.ptp(self.speed[self.usable]))

    @cached_property
    def spectra(self) -> Spectra:
        """Averaged spectra over pieces of 4 s, or half the log; those without a gap, if any are."""
        length = min(len(self.time) // 2, round(SEGMENT / self.period))
        rate = 1 / self.period
        runs = [run for run in self.whole if run.stop - run.start >= length] or [slice(None)]
        weights = [2 * len(self.time[run]) // length - 1 for run in runs]  # pieces overlap by half
        parts = []
        for run in runs:
            u, y = self.torque[run], self.speed[run]
            f, torque = welch(u, fs=rate, nperseg=length)
            _, speed = welch(y, fs=rate, nperseg=length)
            _, cross = csd(u, y, fs=rate, nperseg=length)
            parts.append((torque, speed, cross))
        torque, speed, cross = (
            np.average(each, axis=0, weights=weights) for each in zip(*parts, strict=True)
        )
        pieces = sum(len(self.time[run]) // length for run in runs)
        return Spectra(f, torque, speed, cross, pieces)

    @cached_property
    def whole(self) -> list[slice]:
        """Stretches in which nothing is missing."""
        edges = np.flatnonzero(np.diff(np.r_[False, self.usable, False].astype(int)))
        return [slice(int(i), int(j)) for i, j in edges.reshape(-1, 2)]

    @cached_property
    def band(self) -> tuple[float, float]:
        """Frequencies between which 98 % of the power of the torque lies [Hz]."""
        power = self.spectra.torque
        share = np.cumsum(power) / np.sum(power)
        low, high = np.interp([EDGE, 1 - EDGE], share, self.spectra.frequency)
        return float(low), float(high)

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


def of_record(record: Record) -> Evidence:
    """Return what a record alone tells."""
    incremental = record.increment is not None
    speed = record.increment if incremental else record.speed
    if speed is None:
        assert record.angle is not None  # a record has one of the three
        speed, incremental = np.diff(record.angle, prepend=record.angle[0]) / record.period, True
    told = record.versions
    corner = told.get("highpass")
    return Evidence(
        period=record.period,
        time=record.time,
        torque=record.torque,
        speed=speed,
        incremental=incremental,
        usable=np.ones(len(record.time), bool) if record.valid is None else record.valid,
        smooth=told.get("torque") == "smooth",
        kind_because=told.get("torque_because", ""),
        highpass=float(corner) if corner else None,
        angle=record.angle,
    )
