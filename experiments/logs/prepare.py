"""From raw samples to an even grid: gaps, jitter, unwrapping, resampling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.mapping import Raw

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

FEWEST = 200  # samples
ROUNDING = 1e-3  # of a turn
SMALL = 0.1  # of the range of a counter: what it moves in a sample, and misses of its range
MOST_RATE = 10  # times that of the log, to which it may be resampled
MOST_GAPS = 10  # times the samples of a log that its grid may have
LONGEST_STEP = 3.0  # periods between irregular stamps, beyond which nothing is known between them
NEAR = 0.05  # of a period: time stamps nearer to the grid than that are on it
SLOWEST = 1.01  # s, of a sample; spectra are averaged over four seconds


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
        Of torque (its mean over [t_k, t_{k+1})), angle, speed and load_angle those that there
        are; finite everywhere.
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
    signals: dict[str, Array]
    valid: Flags
    period: float
    jitter: float
    wrap: Wrap


def prepare(raw: Raw, *, smooth: bool = False, resample: float | None = None) -> Prepared:
    """Bring a log onto an even grid.

    Parameters
    ----------
    raw : Raw
    smooth : bool
        Whether the torque is smooth rather than held, see `LogMap.smooth`.
    resample : float, optional
        New rate [Hz]; below the log's own, all signals pass the same low-pass without phase.
        The torque is averaged over the new samples: a sample of it here and there would be
        aliased, and ruin the estimates.

    Raises
    ------
    LogError
        If time does not advance, the log is too short, or a rate is impossible.
    """
    period, index, uneven = _grid(raw.time)
    length = int(index[-1]) + 1
    time = raw.time[0] + period * np.arange(length)
    off = raw.time - time[index]
    even = float(np.max(abs(off))) <= NEAR * period
    signals, valid, wrap = {}, np.zeros(length, bool), Wrap()
    valid[index] = True
    if uneven:  # a sample is there where stamps on both sides of it are near
        after = np.clip(np.searchsorted(raw.time, time), 1, len(raw.time) - 1)
        valid = np.diff(raw.time)[after - 1] <= LONGEST_STEP * period
    for name in ("torque", "angle", "speed", "load_angle"):
        values = getattr(raw, name)
        if values is None:
            continue
        there = np.isfinite(values)
        if there.sum() < FEWEST:
            raise LogError(f"{name} has {there.sum()} samples; {FEWEST} or more are needed")
        if not uneven:
            valid[index[~there]] = False
        values, at = values[there], raw.time[there]
        if name.endswith("angle"):
            values, turned = unwrapped(values)
            wrap = turned if name == "angle" else wrap
        if even:
            signals[name] = _placed(values, index[there], length)
        elif name == "torque" and not smooth:
            signals[name] = interval_means(at, values, time, period, smooth=False)
        else:
            signals[name] = np.interp(time, at, values)
    if smooth and resample is None:
        signals["torque"] = interval_means(time, signals["torque"], time, period, smooth=True)
    found = Prepared(time, signals, valid, period, float(np.std(off) / period), wrap)
    if resample is not None:
        found = _resampled(found, resample, smooth=smooth)
    if found.period > SLOWEST:
        raise LogError(
            f"a sample every {found.period:.3g} s: nothing of an axis is seen in less than one a "
            "second; is the unit or the scale of the time right, or the rate?"
        )
    return found


def check_time(time: Array) -> None:
    """Raise a LogError if there are too few samples, or time does not advance."""
    if len(time) < FEWEST:
        raise LogError(f"the log has {len(time)} samples; {FEWEST} or more are needed")
    if not np.isfinite(time).all():
        raise LogError(f"time is missing at sample {int(np.argmin(np.isfinite(time)))}")
    steps = np.diff(time)
    if (steps <= 0).any():
        k = int(np.argmax(steps <= 0))
        raise LogError(
            f"time goes from {time[k]:.9g} s to {time[k + 1]:.9g} s at sample {k + 1}; it must "
            "advance: sort the log, take doubled samples out, or give --rate HZ in its place"
        )


def _grid(time: Array) -> tuple[float, NDArray[np.int64], bool]:
    """Return the period, the place of each sample on the grid, and whether stamps are irregular.

    Irregular ones go to the grid of their median step, on which samples are interpolated.
    """
    check_time(time)
    steps = np.diff(time)
    median = float(np.median(steps))
    places = np.concatenate([[0], np.cumsum(np.maximum(np.rint(steps / median), 1))]).astype(int)
    # the median of jittered or rounded stamps is off by a little, which adds up: fit the grid
    period = float(np.polyfit(places, time, 1)[0]) if places[-1] else median
    places = np.rint((time - time[0]) / period).astype(int)
    uneven = bool((np.diff(places) <= 0).any())
    if uneven:
        period = median
        places = np.floor((time - time[0]) / period * (1 + 1e-12)).astype(int)
    if places[-1] > MOST_GAPS * len(time):
        raise LogError(
            "the time stamps are too irregular for an even grid (mostly gaps); resample the log "
            "first, or give --rate HZ in place of the time"
        )
    return period, places, uneven


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


def _placed(values: Array, index: NDArray[np.int64], length: int) -> Array:
    if len(values) == length:
        return values.copy()
    return np.interp(np.arange(length), index, values)


def interval_means(at: Array, values: Array, time: Array, period: float, *, smooth: bool) -> Array:
    """Return the means over [t, t + T) of a signal that is held, or smooth, between samples."""
    edges = np.clip(np.append(time, time[-1] + period), at[0], at[-1])
    if smooth:
        integral = CubicSpline(at, values).antiderivative()(edges)
    else:
        area = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(at))])
        integral = np.interp(edges, at, area)
    width = np.diff(edges)
    # after the last sample nothing is known: its value is kept
    means = np.divide(
        np.diff(integral), width, out=np.full(len(width), values[-1]), where=width > 0
    )
    return means


def _resampled(old: Prepared, rate: float, *, smooth: bool) -> Prepared:
    if not 0 < rate <= MOST_RATE / old.period:
        raise LogError(
            f"--resample {rate:g} Hz: give a rate above 0, and not above {MOST_RATE} times that of "
            f"the log, {1 / old.period:.6g} Hz"
        )
    period = 1 / rate
    span = old.time[-1] - old.time[0]
    if not period < span / FEWEST:
        raise LogError(
            f"--resample {rate:g} Hz leaves {int(span / period)} samples; {FEWEST} are needed"
        )
    signals, at = dict(old.signals), old.time
    if period > 1.001 * old.period:
        lowpass = butter(8, 0.8 * old.period / period, output="sos")
        signals = {name: sosfiltfilt(lowpass, values) for name, values in signals.items()}
        if not smooth:  # what has passed a low-pass is no longer held, but smooth between middles
            at, smooth = old.time + old.period / 2, True
    time = old.time[0] + period * np.arange(int(span / period * (1 + 1e-9)) + 1)
    new = {}
    for name, values in signals.items():
        if name == "torque":
            new[name] = interval_means(at, values, time, period, smooth=smooth)
        else:
            new[name] = CubicSpline(old.time, values)(time)
    # a new sample is there if the old ones on both sides of it are
    there = np.interp(time, old.time, old.valid.astype(float)) > 1 - 1e-9
    return Prepared(time, new, there, period, old.jitter, old.wrap)
