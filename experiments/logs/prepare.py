"""From raw samples to an even grid: time stamps, gaps, unwrapping, interpolation, resampling."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.mapping import Raw

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

FEWEST = 200  # samples
CLOCKS = (2**32 * 1e-6, 86400.0, 2**32 * 1e-3, 2**16 * 1e-3)  # s, after which clocks begin again
ROUNDING = 1e-3  # of a turn
SMALL = 0.1  # of the range of a counter: what it moves in a sample, and misses of its range
MOST_GAPS = 10  # times the samples of a log that its grid may have
NEAR = 0.05  # of a period: time stamps nearer to the grid than that are on it
SLOWEST = 1.01  # s, of a sample; spectra are averaged over four seconds
WITHIN = 2.05  # ticks of an even grid, of stamps that are rounded
FARTHEST = 1.2  # times the usual move, of a step in which no row is missing
LONGEST = 200_000  # samples that are looked at
STRAIGHT, LINED = 1e-3, 0.45  # of the usual bend, and share of the samples, of lines
MOST_KNOTS, BENDS = 21, 0.95  # samples between updates, and share of the changes at them
MOVING = 3.0  # steps of its resolution by which a signal moves between its updates


@dataclass(frozen=True)
class Wrap:
    """How an angle was unwrapped.

    Attributes
    ----------
    turn : float
        What was added at each jump [rad]; 0 for an angle that does not wrap.
    jumps : int
    fastest : float
        Greatest move within one sample afterwards, over `turn`.
    """

    turn: float = 0.0
    jumps: int = 0
    fastest: float = 0.0


@dataclass(frozen=True)
class Prepared:
    """Signals on an even grid.

    Attributes
    ----------
    time : ndarray (N,)
        [s].
    signals : dict of str to ndarray (N,)
        Of torque (its mean over [t_k, t_{k+1})), angle and speed those that the log has; finite
        everywhere.
    valid : ndarray (N,) of bool
        False where something is missing.
    period : float
        [s].
    jitter : float
        Standard deviation of the time stamps about an even grid, over the period.
    wrap : Wrap
        How the angle was unwrapped.
    """

    time: Array
    signals: Mapping[str, Array]
    valid: Flags
    period: float
    jitter: float
    wrap: Wrap


def on_clock(raw: Raw) -> tuple[Raw, str]:
    """Return a log whose time advances, and what was done to its stamps.

    A clock that begins again is continued; stamps coarser than the sampling become even.

    Raises
    ------
    LogError
        If there are too few samples, or time does not advance.
    """
    known = np.isfinite(raw.time)  # a row without time is a gap
    signals = {name: values[known] for name, values in raw.signals.items()}
    for name, values in {"time": raw.time[known], **signals}.items():
        if (count := int(np.isfinite(values).sum())) < FEWEST:
            raise LogError(f"{name} has {count} samples; {FEWEST} or more are needed")
    time, remark = raw.time[known] - raw.time[known][0], ""
    for turn in CLOCKS:
        if 0.99 * turn < -np.diff(time).min() < 1.01 * turn:
            time, remark = np.unwrap(time, period=turn), f"the clock restarts after {turn:.9g} s"
    if tick := coarse_tick(time, signals):
        time = np.linspace(time[0], time[-1], len(time))
        remark = f"stamps are rounded to {1e3 * tick:.3g} ms; the sampling is taken as even"
    back = np.flatnonzero(np.diff(time) <= 0)
    if len(back):
        k = int(back[0]) + 1
        text = f"time goes from {time[k - 1]:.9g} s to {time[k]:.9g} s after the start at row {k}"
        if time[k] < 0.05 * time[k - 1]:
            raise LogError(f"{text}: a new log begins there; take one with --rows 0:{k} or {k}:")
        raise LogError(
            f"{text}, and does not advance at {len(back)} rows: take out rows that are logged "
            "twice or out of order, or, if the sampling was even, give --rate HZ in place of time"
        )
    return replace(raw, time=time + raw.time[known][0], signals=signals), remark


def coarse_tick(time: Array, signals: Mapping[str, Array]) -> float:
    """Return the tick to which stamps of an even sampling are rounded [s]; 0 if they are not.

    Stamps within a tick of an even grid may also be those of a log with missing rows. There, the
    signals move farther over a longer step.
    """
    steps = np.diff(time)
    if not steps.any():  # the same stamp in every row
        return 0.0
    least, still = steps.min(), np.mean(steps == 0)
    tick = float(np.median(steps[steps > 0])) if still > SMALL else float(np.ptp(steps))
    grid = np.linspace(time[0], time[-1], len(time))
    if least < 0 or (still <= SMALL and not NEAR * least < tick < (1 + SMALL) * least):
        return 0.0
    off = (steps - least) / tick  # jitter is between the multiples of a tick
    if np.ptp(time - grid) > WITHIN * tick or np.mean(np.abs(off - np.rint(off)) > SMALL) > SMALL:
        return 0.0
    if abs(least - tick) < SMALL * tick:  # a row may be missing in each step of two ticks
        long, moves = steps > 1.5 * tick, [np.abs(np.diff(values)) for values in signals.values()]
        far = [np.nanmedian(m[long]) / max(np.nanmedian(m[~long]), 1e-300) for m in moves]
        return tick if max(far) < FARTHEST else 0.0
    return tick


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


def resolution(values: Array) -> float:
    """Return the step of which a signal is made; 0 if it is finer than its changes."""
    steps = np.abs(np.diff(values[np.isfinite(values)][:LONGEST]))
    moved = steps[steps > 1e-9 * max(float(np.ptp(values)), 1e-300)]
    if not len(moved):
        return 0.0
    smallest = float(np.percentile(moved, 1))
    multiples = moved / smallest
    # steps without a quantum lie within .05 of a whole number in a tenth of the cases
    return smallest if np.mean(np.abs(multiples - np.rint(multiples)) < 0.05) > 0.9 else 0.0


def without_interpolation(raw: Raw) -> tuple[Raw, str]:
    """Return the samples that a log was interpolated from, where it was, and a remark on that."""
    n, first, lines = rhythm(raw.signals["torque"])
    if not lines or rhythm(raw.signals[raw.motion]) != (n, first, lines):
        return raw, ""
    part = slice(first, None, n)
    signals = {name: values[part] for name, values in raw.signals.items()}
    remark = f"torque and {raw.motion} are lines between every {n}th row: only these are samples"
    return replace(raw, time=raw.time[part], signals=signals), remark


def prepare(raw: Raw, *, smooth: bool = False, resample: float | None = None) -> Prepared:
    """Bring a log onto an even grid.

    Parameters
    ----------
    raw : Raw
        Whose time advances.
    smooth : bool
        Whether the torque is smooth rather than held, see `LogMap`.
    resample : float, optional
        New rate [Hz], below that of the log; all signals pass the same low-pass without phase.
        The torque is averaged over the new samples: a sample of it here and there would be
        aliased, and ruin the estimates.

    Raises
    ------
    LogError
        If a rate is impossible.
    """
    period, index = _grid(raw.time)
    time = raw.time[0] + period * np.arange(index[-1] + 1.0)
    off = raw.time - time[index]
    even = np.max(abs(off)) <= NEAR * period
    stamps = time[index] if even else raw.time
    signals, wrap, valid = {}, Wrap(), np.isin(np.arange(len(time)), index)
    for name, logged in raw.signals.items():
        known = np.isfinite(logged)
        valid[index[~known]] = False
        values, at = logged[known], stamps[known]
        if name == "angle":
            values, wrap = unwrapped(values)
        if name == "torque" and not smooth:  # it stays until the next sample, whenever that is
            at = time[index[known]]
        signals[name] = np.interp(time, at, values)
    result = Prepared(time, signals, valid, period, float(np.std(off) / period), wrap)
    if resample is not None:
        result = _resampled(result, resample, smooth=smooth)
    elif smooth:
        signals["torque"] = interval_means(time, signals["torque"], time, period)
    if result.period > SLOWEST or (result.period >= 1 and "time" not in raw.stated):
        raise LogError(
            f"a sample every {result.period:.3g} s: that is too slow for an axis; is time in ms, "
            "us or ns? State it with --unit time=us, or, if it is right, --unit time=s"
        )
    return result


def _grid(time: Array) -> tuple[float, NDArray[np.int64]]:
    """Return the period, and the place of each sample on the grid."""
    steps = np.diff(time)
    places = np.r_[0, np.cumsum(np.maximum(np.rint(steps / np.median(steps)), 1))]
    # the median of jittered or rounded stamps is off by a little, which adds up: fit the grid
    places -= places.mean()
    period = float(places @ (time - time[0]) / (places @ places))
    index = np.rint((time - time[0]) / period).astype(int)
    if (np.diff(index) <= 0).any() or index[-1] > MOST_GAPS * len(time):
        raise LogError(
            f"the time stamps are too irregular for an even grid: steps of {steps.min():.3g} s to "
            f"{steps.max():.3g} s; resample the log first, or, if the sampling was even, give "
            "--rate HZ in place of the time"
        )
    return period, index


def unwrapped(angle: Array) -> tuple[Array, Wrap]:
    """Return an angle without the jumps of wrapping, if it wraps.

    It does where its values stay within one turn, or within a whole number of them as those of a
    counter do, and jump by nearly all of that. Any other angle is left alone, however fast: an
    encoder that moves by more than half a turn in a sample would be folded into nonsense.

    Examples
    --------
    >>> turn = np.arange(500) * 0.5
    >>> bool(np.allclose(unwrapped(turn % (2 * np.pi))[0], turn))
    True
    >>> unwrapped(np.arange(500) * 4.0)[1].jumps
    0
    """
    span, steps = float(np.ptp(angle)), np.abs(np.diff(angle))
    turns = max(float(np.ceil(span / (2 * np.pi) - ROUNDING)), 1.0)
    turn = 2 * np.pi * turns
    jumps = steps > (0.5 if turns == 1 else 1 - SMALL) * turn
    if not jumps.any() or (turns > 1 and steps[~jumps].max() > SMALL * turn):
        return angle, Wrap()
    free = np.unwrap(angle, period=turn)
    return free, Wrap(turn, int(jumps.sum()), float(np.abs(np.diff(free)).max()) / turn)


def interval_means(at: Array, values: Array, time: Array, period: float) -> Array:
    """Return the means over [t, t + T) of a signal that is smooth between samples."""
    edges = np.clip(np.append(time, time[-1] + period), at[0], at[-1])
    width, integral = np.diff(edges), CubicSpline(at, values).antiderivative()(edges)
    last = np.full(len(width), values[-1])  # after the last sample its value is kept
    return np.divide(np.diff(integral), width, out=last, where=width > 0)


def _resampled(old: Prepared, rate: float, *, smooth: bool) -> Prepared:
    span, period = old.time[-1] - old.time[0], 1 / rate
    if not FEWEST / span < rate < 1 / old.period:
        raise LogError(
            f"--resample {rate:g} Hz: give a rate above {FEWEST / span:.3g} Hz, for {FEWEST} "
            f"samples, and below that of the log, {1 / old.period:.6g} Hz"
        )
    lowpass = butter(8, 0.8 * old.period / period, output="sos")
    signals = {name: sosfiltfilt(lowpass, values) for name, values in old.signals.items()}
    time = old.time[0] + period * np.arange(int(span / period * (1 + 1e-9)) + 1)
    new = {name: CubicSpline(old.time, values)(time) for name, values in signals.items()}
    # what has passed a low-pass is no longer held, but smooth between middles
    at = old.time if smooth else old.time + old.period / 2
    new["torque"] = interval_means(at, signals["torque"], time, period)
    # a new sample is known if the old ones on both sides of it are
    valid = np.interp(time, old.time, old.valid.astype(float)) > 1 - 1e-9
    return replace(old, time=time, signals=new, valid=valid, period=period)
