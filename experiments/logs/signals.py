"""What of a record an identification reads: signals, gaps, and what acts beside the torque."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import median_abs_deviation

from flexaxis.experiments.logs.axis_file import Axis, is_smooth, output_of, usable
from flexaxis.experiments.logs.prepare import resolution
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SIDED = 0.01  # s, over which the speed is a mean whose sign counts
RESTING = 0.05  # of the deviation of the speed, below which an axis rests
FIRST, CLEAR = 5, 3.0  # samples by which the first speed is told, and times their noise
UNKNOWN, ROOM = 120, 2e7  # unknown states behind gaps, and numbers in derivatives by them, at most


@dataclass(frozen=True)
class Log:
    """What of a record an identification reads.

    Attributes
    ----------
    u, y : ndarray (N,)
        Torque as logged, and the output.
    ok : ndarray (N,) of bool
        Usable samples.
    period : float
        [s].
    output : {"speed", "increment"}
    smooth : bool
        Whether the torque goes on changing between samples.
    resting : bool
        Whether it begins at rest.
    angle : ndarray (N,)
        Of the load by the gear ratio, as measured at the motor, or from where it starts.
    """

    u: Array
    y: Array
    ok: Flags
    period: float
    output: str
    smooth: bool
    resting: bool
    angle: Array

    @property
    def rounding(self) -> float:
        """Standard deviation of the noise by the steps of a coarse sensor [rad/s]."""
        if self.output == "speed":
            return resolution(self.y[self.ok]) / np.sqrt(12)
        return resolution(self.angle[self.ok]) / np.sqrt(6) / self.period

    def begins(self, states: int, later: int) -> list[int]:
        """Return where stretches begin: the log, and what comes behind its longest gaps.

        The torque in a gap is not known, nor the state that it leads to: that is estimated, of so
        many states and as many samples later. Behind all other gaps a line of the torque leads
        there.
        """
        # a state that is forgotten before the first usable sample could be any
        first = 0 if self.resting else int(np.argmax(self.ok))
        missing = np.flatnonzero(np.diff(np.r_[True, self.ok, True])).reshape(-1, 2).tolist()
        gaps = [(begin, end) for begin, end in missing if begin and end < len(self.ok)]
        most = int(min(UNKNOWN, ROOM // len(self.ok))) // states if states else 0
        longest = sorted(gaps, key=lambda gap: gap[0] - gap[1])[:most]
        return [first, *sorted({end + later for _, end in longest if end + later < len(self.ok)})]

    def part(self, most: int) -> slice:
        """Return the stretch of that many samples with the greatest torque, or all."""
        begins = np.linspace(0, max(len(self.u) - most, 0), 9).astype(int)
        energy = np.cumsum(np.where(self.ok, self.u, 0.0) ** 2)
        ends = np.minimum(begins + most, len(self.u)) - 1
        begin = int(begins[np.argmax(energy[ends] - energy[begins])])
        return slice(begin, begin + most)

    def cut(self, piece: slice) -> Log:
        """Return a piece of it."""
        sides = {name: getattr(self, name)[piece] for name in ("u", "y", "ok", "angle")}
        return replace(self, **sides, resting=self.resting and piece.start == 0)


def log_of(record: Record, axis: Axis) -> Log:
    """Return what of a record is read, with its torque as the axis knows it to be."""
    output = output_of(record)
    y = np.asarray(getattr(record, output))
    angle = np.cumsum(y) * record.period if record.angle is None else record.angle
    angle = axis.model.nominal.get("r", 1.0) * angle
    beside = columns_beside(angle, y, record.period) if axis.beside else {}
    ok = usable(record)
    # but for its noise
    still = abs(float(np.mean(y[:FIRST]))) < RESTING * float(np.std(y)) + CLEAR * noise_of(y)
    return Log(
        u=record.torque + sum(gain * beside[name] for name, gain in axis.beside.items()),
        y=y,
        ok=ok,
        period=record.period,
        output=output,
        smooth=is_smooth(record),
        resting=record.burn_in == 0 and still and bool(ok[0]),
        angle=angle,
    )


def columns_beside(angle: Array, speed: Array, period: float) -> dict[str, Array]:
    """Return what acts beside a torque (N,), by the name of its gain.

    −sin φ and −cos φ of gravity, φ half way to the next sample; −|v| of viscous friction that is
    greater forwards than backwards.
    """
    half = (angle + np.append(angle[1:], angle[-1])) / 2
    length = max(round(SIDED / period), 1)
    mean = np.convolve(np.append(speed[1:], speed[-1]), np.ones(length) / length, "same")
    return {"g_sin": -np.sin(half), "g_cos": -np.cos(half), "f_sided": -abs(mean)}


def noise_of(y: Array) -> float:
    """Return the standard deviation of white noise on a motion, from differences over a sample."""
    return float(median_abs_deviation(y[2:] - y[:-2], scale="normal")) / np.sqrt(2)
