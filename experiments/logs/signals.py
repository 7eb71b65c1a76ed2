"""What samples show: gaps, resolution, rhythm and wraps; and what identification reads of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import median_abs_deviation

from flexaxis.experiments.logs.axis_file import Axis, is_smooth, output_of, usable
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SIDED = 0.01  # s, over which the speed is averaged before its sign counts
RESTING = 0.05  # of the deviation of the speed, below which an axis rests
FIRST, CLEAR = 5, 3.0  # samples that give the first speed; multiple of their noise
UNKNOWN, ROOM = 120, 2e7  # unknown states behind gaps; numbers in the derivatives by them, at most
LONGEST = 200_000  # samples that are looked at
STRAIGHT, LINED = 1e-3, 0.45  # of the usual bend, and share of the samples, of lines
MOST_KNOTS, BENDS = 21, 0.95  # samples between updates; share of the changes that are at updates
MOVING = 3.0  # steps of its resolution by which a signal moves between its updates
ROUNDING = 1e-3  # of a turn
SMALL = 0.1  # of the range of a counter: its moves in a sample, and its distance from whole turns


def gaps_of(ok: Flags) -> NDArray[np.int64]:
    """Return where each run of False in flags (N,) begins, and where it has ended: (m, 2).

    Examples
    --------
    >>> gaps_of(np.array([True, False, False, True, False])).tolist()
    [[1, 3], [4, 5]]
    """
    return np.flatnonzero(np.diff(np.r_[True, ok, True])).reshape(-1, 2)


def liveliest(x: Array, length: int) -> slice:
    """Return the stretch of that many samples in which a signal (N,) has most power, or all."""
    power, length = np.cumsum(np.r_[0.0, x**2]), min(length, len(x))
    begin = int(np.argmax(power[length:] - power[:-length]))
    return slice(begin, begin + length)


def resolution(values: Array) -> float:
    """Return the step between the levels of a signal; 0 if its values are no multiples of one.

    Examples
    --------
    >>> resolution(np.array([0.0, 0.3, 0.1, np.nan, 0.4]))
    0.1
    """
    levels = np.unique(values[np.isfinite(values)][:LONGEST])
    steps = np.diff(levels)
    steps = steps[steps > 1e-9 * np.ptp(levels)]
    if not len(steps):
        return 0.0
    multiples = steps / steps.min()
    counts = np.rint(multiples)
    # of other steps a tenth lies within 0.05 of a whole number
    lattice = np.mean(np.abs(multiples - counts) < 0.05) > 0.9
    return float(steps.sum() / counts.sum()) if lattice else 0.0


def rhythm(values: Array) -> tuple[int, int, bool]:
    """Return after how many samples a signal is updated, the first such, and whether by lines.

    Between updates a signal is held, or interpolated linearly. 1, 0 where it is updated at every
    sample, or where steps of its resolution hide that.

    Examples
    --------
    >>> k = np.arange(4000)
    >>> rhythm(np.interp(k, k[2::4], np.sin(k[2::4] ** 1.5)))
    (4, 2, True)
    >>> rhythm(np.sin(k // 5))
    (5, 0, False)
    """
    x = values[np.isfinite(values)][:LONGEST]
    moves = np.abs(np.diff(x))
    jumps, digit = moves[moves > 0], resolution(x)
    for lines in (True, False):
        change = np.abs(np.diff(x, 2)) if lines else moves
        straight, most = np.percentile(change, [40, 99])  # at least half is rounding, along lines
        bent = change > max(STRAIGHT * most, 4 * straight)
        seen = (~bent & (moves[1:] > 0)).mean() > LINED if lines else len(jumps) > 20
        if not seen or np.median(jumps) < MOVING * digit:
            continue
        for n in range(2, MOST_KNOTS):
            share = [bent[r::n].sum() / max(bent.sum(), 1) for r in range(n)]
            if max(share) > BENDS and bent.sum() > 0.5 * len(bent) / n:
                return n, (int(np.argmax(share)) + 1) % n, lines
    return 1, 0, False


def unwrapped(angle: Array) -> tuple[Array, float]:
    """Return an angle without the jumps of wrapping, and the turn that it wraps at [rad] or 0.

    An angle wraps if its values stay within one turn, or within a whole number of turns as those
    of a counter, and jump by nearly all of that. Any other angle is left alone, however fast: an
    encoder that moves by more than half a turn in a sample would be folded into nonsense.

    Examples
    --------
    >>> turn = np.arange(500) * 0.5
    >>> bool(np.allclose(unwrapped(turn % (2 * np.pi))[0], turn))
    True
    >>> unwrapped(np.arange(500) * 4.0)[1]
    0.0
    """
    steps = np.abs(np.diff(angle))
    turns = max(float(np.ceil(np.ptp(angle) / (2 * np.pi) - ROUNDING)), 1.0)
    turn = 2 * np.pi * turns
    jumps = steps > (0.5 if turns == 1 else 1 - SMALL) * turn
    if not jumps.any() or (turns > 1 and steps[~jumps].max() > SMALL * turn):
        return angle, 0.0
    return np.unwrap(angle, period=turn), turn


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
        return resolution(self.y[self.ok]) / np.sqrt(12 if self.output == "speed" else 6)

    def begins(self, states: int, later: int) -> list[int]:
        """Return where stretches begin: the log, and what comes behind its longest gaps.

        The torque in a gap is not known, nor the state that it leads to: that is estimated, of so
        many states and as many samples later. Behind all other gaps a line of the torque leads
        there.
        """
        # a state that is forgotten before the first usable sample could be any
        first = 0 if self.resting else int(np.argmax(self.ok))
        missing = gaps_of(self.ok).tolist()
        gaps = [(begin, end) for begin, end in missing if begin and end < len(self.ok)]
        most = int(min(UNKNOWN, ROOM // len(self.ok))) // states if states else 0
        longest = sorted(gaps, key=lambda gap: gap[0] - gap[1])[:most]
        return [first, *sorted({end + later for _, end in longest if end + later < len(self.ok)})]

    def part(self, most: int) -> slice:
        """Return the stretch of that many samples with the greatest torque, or all."""
        return liveliest(np.where(self.ok, self.u, 0.0), most)

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
