"""Analyse the signals of a log, and prepare them for an identification."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import median_abs_deviation

from flexaxis.experiments.logs.axis_file import Axis, output_of, usable
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

RESTING = 0.05  # maximum speed of an axis at rest, relative to the standard deviation of the speed
FIRST, CLEAR = 5, 3.0  # number of samples that determine the initial speed; factor on their noise
LONGEST = 200_000  # maximum number of samples of a signal that are examined
STRAIGHT = 1e-3  # maximum relative second difference of samples on a straight line
MOST_KNOTS, BENDS = 21, 0.95  # maximum samples between updates, plus 1; share of changes at updates
MOVING = 3.0  # minimum move of a signal between updates, in steps of its resolution
ROUNDING = 1e-3  # rounding error of the range of an angle, in turns
SMALL = 0.1  # maximum move per sample, and maximum unused range, relative to a counter's range


def gaps_of(ok: Flags) -> NDArray[np.int64]:
    """Return the start and stop indices (m, 2) of all runs of False in a mask (N,).

    Examples
    --------
    >>> gaps_of(np.array([True, False, False, True, False])).tolist()
    [[1, 3], [4, 5]]
    """
    return np.flatnonzero(np.diff(np.r_[True, ok, True])).reshape(-1, 2)


def liveliest(x: Array, length: int) -> slice:
    """Return the stretch of at most `length` samples in which a signal (N,) has the most power."""
    power, length = np.cumsum(np.r_[0.0, x**2]), min(length, len(x))
    begin = int(np.argmax(power[length:] - power[:-length]))
    return slice(begin, begin + length)


def resolution(values: Array) -> float:
    """Return the quantisation step of a signal, or 0 if the signal is not quantised.

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
    # for random values, a tenth of the multiples are within 0.05 of a whole number
    lattice = np.mean(np.abs(multiples - counts) < 0.05) > 0.9
    return float(steps.sum() / counts.sum()) if lattice else 0.0


def rhythm(values: Array) -> tuple[int, int, bool]:
    """Return how often a signal is updated, and whether it is interpolated between updates.

    Between updates, a signal is held or interpolated linearly. The result contains the update
    interval in samples, the index of the first update, and a flag that is True if the signal is
    interpolated. The result is ``(1, 0, False)`` if the signal is updated at every sample, or if
    its resolution is too coarse to detect updates.

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
    jumps = moves[moves > 0]
    if not len(jumps) or np.median(jumps) < MOVING * resolution(x):
        return 1, 0, False
    for lines in (True, False):
        change = np.abs(np.diff(x, 2)) if lines else moves
        straight, most = np.percentile(change, [40, 99])  # on lines, at least half is rounding
        bent = change > max(STRAIGHT * most, 4 * straight)
        for n in range(2, MOST_KNOTS):
            share = [bent[r::n].sum() / max(bent.sum(), 1) for r in range(n)]
            if max(share) > BENDS and bent.sum() > 0.5 * len(bent) / n:
                return n, (int(np.argmax(share)) + 1) % n, lines
    return 1, 0, False


def unwrapped(angle: Array) -> tuple[Array, float]:
    """Return an unwrapped angle, and the range [rad] of the wrapped angle (0 if it did not wrap).

    An angle with a range of one turn counts as wrapped if it jumps by more than half a turn. An
    angle with a range of several whole turns (a counter) counts as wrapped if it jumps by nearly
    the whole range. Any other angle is returned unchanged, because unwrapping would corrupt an
    angle that moves by more than half a turn per sample.

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
    """The signals of a record that are used for identification.

    Attributes
    ----------
    u, y : ndarray (N,)
        Torque in the unit of the log, and measured speed or increment [rad/s].
    ok : ndarray (N,) of bool
        Usable samples.
    period : float
        Sampling period [s].
    output : {"speed", "increment"}
        Kind of output.
    smooth : bool
        Whether the torque also changes between samples.
    resting : bool
        Whether the log begins at rest.
    angle : ndarray (N,)
        Motor angle times the gear ratio [rad]. A missing angle is computed from the speed.
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
        """Standard deviation of the noise due to the resolution of the sensor [rad/s]."""
        if self.output == "speed":
            return resolution(self.y[self.ok]) / np.sqrt(12)
        return resolution(self.angle[self.ok]) / np.sqrt(6) / self.period


def log_of(record: Record, axis: Axis) -> Log:
    """Return the signals of a record. The known gravity torque is added to the torque."""
    output, y = output_of(record)
    angle = np.cumsum(y) * record.period if record.angle is None else record.angle
    angle = axis.model.nominal.get("r", 1.0) * angle
    beside = columns_beside(angle)
    ok = usable(record)
    # because of noise, the measured speed of an axis at rest may differ from 0
    still = abs(float(np.mean(y[:FIRST]))) < RESTING * float(np.std(y)) + CLEAR * noise_of(y)
    u = record.torque + sum(gain * beside[name] for name, gain in axis.beside.items())
    smooth = record.versions.get("torque") == "smooth"
    resting = record.burn_in == 0 and still and bool(ok[0])
    return Log(u, y, ok, record.period, output, smooth, resting, angle)


def columns_beside(angle: Array) -> dict[str, Array]:
    """Return a dict of the gravity regressors (N,). The keys are the names of their gains.

    The regressors are −sin φ and −cos φ, where φ is the mean angle over the next sampling period T.
    This mean is computed from a cubic polynomial through four angles. The mean of only two angles
    would have an error of T²/12 times the acceleration, which would bias the inertia estimate.
    """
    weights = np.array([-1, 13, 13, -1]) / 24
    mean = np.convolve(np.pad(angle, (1, 2), "edge"), weights, "valid")
    return {"g_sin": -np.sin(mean), "g_cos": -np.cos(mean)}


def noise_of(y: Array) -> float:
    """Return the standard deviation of white noise in a signal y, estimated from y[k+2] − y[k]."""
    return float(median_abs_deviation(y[2:] - y[:-2], scale="normal")) / np.sqrt(2)
