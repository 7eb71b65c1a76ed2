"""Gaps, resolution, update rate and wraps of signals; the signals that identification reads."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import median_abs_deviation

from flexaxis.experiments.logs.axis_file import Axis, is_smooth, output_of, usable
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

RESTING = 0.05  # of the standard deviation of the speed: below that, an axis rests
FIRST, CLEAR = 5, 3.0  # samples that give the first speed; factor on their noise
UNKNOWN, ROOM = 30, 2e7  # largest numbers of unknown states after gaps, and of their derivatives
LONGEST = 200_000  # samples of a signal that are examined
STRAIGHT, LINED = 1e-3, 0.45  # of the usual second difference; share of the samples on lines
MOST_KNOTS, BENDS = 21, 0.95  # samples between updates; share of changes at the updates
MOVING = 3.0  # steps of its resolution: least move of a signal between updates
ROUNDING = 1e-3  # of a turn
SMALL = 0.1  # of the range of a counter: largest move per sample, and largest gap at the ends


def gaps_of(ok: Flags) -> NDArray[np.int64]:
    """Return begin and end (m, 2) of each run of False in flags (N,), as in a slice.

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
    """Return the quantisation step of a signal; 0 if its values are not on a grid.

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
    # by chance, a tenth of the multiples is within 0.05 of a whole number
    lattice = np.mean(np.abs(multiples - counts) < 0.05) > 0.9
    return float(steps.sum() / counts.sum()) if lattice else 0.0


def rhythm(values: Array) -> tuple[int, int, bool]:
    """Return the samples between updates, the first update, and whether lines connect them.

    Between updates, a signal is held or interpolated linearly. The result is 1, 0, False if it is
    updated at every sample, or if the steps of its resolution hide the updates.

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
        straight, most = np.percentile(change, [40, 99])  # along lines, at least half is rounding
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
    """The signals of a record for identification.

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
        Motor angle times the gear ratio; the integral of the speed if no angle was measured.
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
        """Return where stretches with an initial state of their own begin.

        These are the start of the log and the ends of its longest gaps. The torque in a gap is
        unknown, and so is the state after it. In all other gaps the torque is a straight line.

        Parameters
        ----------
        states : int
            Number of states of the model.
        later : int
            Samples after a gap in which its torque still acts.
        """
        # before the first usable sample, any initial state is forgotten
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
    """Return the signals of a record; the torque includes the known gains of the axis."""
    output = output_of(record)
    y = np.asarray(getattr(record, output))
    angle = np.cumsum(y) * record.period if record.angle is None else record.angle
    angle = axis.model.nominal.get("r", 1.0) * angle
    beside = columns_beside(angle) if axis.beside else {}
    ok = usable(record)
    # apart from the noise
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


def columns_beside(angle: Array) -> dict[str, Array]:
    """Return regressors (N,) of gravity, by the name of their gain.

    These are −sin φ and −cos φ, with φ half a sample later.
    """
    half = (angle + np.append(angle[1:], angle[-1])) / 2
    return {"g_sin": -np.sin(half), "g_cos": -np.cos(half)}


def noise_of(y: Array) -> float:
    """Return the standard deviation of white noise on a motion, from differences over a sample."""
    return float(median_abs_deviation(y[2:] - y[:-2], scale="normal")) / np.sqrt(2)
