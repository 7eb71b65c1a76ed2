"""What may happen to an axis and its sensor; a minute of good data follows each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from acceptance.axes import Run, simulate

BEFORE = 20.0  # s of good data, unless the disturbance comes first
AFTER = 60.0  # s


@dataclass(frozen=True)
class Disturbed:
    """
    A run with a disturbance.

    Attributes
    ----------
    run : Run
    valid : (N,) bool array
        False where y is missing.
    rest : (first, stop)
        Samples in which nothing can be learnt: no finding may come there.
    """

    run: Run
    valid: np.ndarray
    rest: tuple[int, int]


def _whole(run: Run, rest: tuple[int, int] = (0, 0)) -> Disturbed:
    return Disturbed(run, np.ones(len(run.u), bool), rest)


def _span(run: Run, seconds: float) -> slice:
    return slice(run.samples(BEFORE), run.samples(BEFORE + seconds))


def at_rest_first(axis, seconds, **options) -> Disturbed:
    """The drive is off at first: torque and speed are exactly zero."""
    run = simulate(axis, AFTER, **options)
    N = run.samples(seconds)
    u, y, clean = (np.r_[np.zeros(N), signal] for signal in (run.u, run.y, run.clean))
    theta = np.vstack([np.repeat(run.theta[:1], N, axis=0), run.theta])
    return _whole(Run(u, y, clean, theta, run.period), (0, N))


def drive_off(axis, seconds, **options) -> Disturbed:
    """The drive is switched off: the axis coasts for a second, then all is exactly zero."""
    run = simulate(axis, BEFORE + seconds + AFTER, off=(BEFORE, BEFORE + seconds), **options)
    span = _span(run, seconds)
    return _whole(run, (span.start, span.stop))


def noise_alone(axis, seconds, **options) -> Disturbed:
    """As `drive_off`, but the sensor goes on being noisy."""
    given = drive_off(axis, seconds, **options)
    y, span = given.run.y.copy(), slice(*given.rest)
    y[span] = options.get("sigma", 0.1) * np.random.default_rng(5).standard_normal(
        span.stop - span.start
    )
    y[span] += given.run.clean[span]
    return replace(given, run=replace(given.run, y=y))


def pause(axis, seconds, **options) -> Disturbed:
    """The reference is held; a second later the axis stands still under control."""
    run = simulate(axis, BEFORE + seconds + AFTER, held=(BEFORE, BEFORE + seconds), **options)
    span = _span(run, seconds)
    return _whole(run, (span.start, span.stop))


def gap(axis, samples, **options) -> Disturbed:
    """Outputs are missing while the axis goes on."""
    seconds = samples * options.get("period", 0.005)
    run = simulate(axis, BEFORE + seconds + AFTER, **options)
    span = _span(run, seconds)
    valid = np.ones(len(run.u), bool)
    valid[span] = False
    y = np.where(valid, run.y, 0.0)
    return Disturbed(replace(run, y=y), valid, (span.start, span.stop))


def outlier(axis, size, **options) -> Disturbed:
    """One output is nonsense."""
    run = simulate(axis, BEFORE + AFTER, **options)
    y = run.y.copy()
    y[run.samples(BEFORE)] = size
    return _whole(replace(run, y=y))


def sensor_fails(axis, seconds, *, kind: str, **options) -> Disturbed:
    """The sensor reads 5 rad/s, or no more than 3, or its last value, while the axis goes on."""
    run = simulate(axis, BEFORE + seconds + AFTER, **options)
    y, span = run.y.copy(), _span(run, seconds)
    kinds = {"constant": 5.0, "saturated": np.clip(y[span], -3.0, 3.0), "stuck": y[span.start]}
    y[span] = kinds[kind]
    return _whole(replace(run, y=y))


def in_mid_motion(axis, seconds, **options) -> Disturbed:
    """The estimator is started while the axis moves."""
    run = simulate(axis, seconds + AFTER, **options)
    N = run.samples(seconds)
    parts = (signal[N:] for signal in (run.u, run.y, run.clean, run.theta))
    return _whole(Run(*parts, period=run.period))


DISTURBANCES: Mapping[str, Callable[..., Disturbed]] = {
    "a minute at rest first": partial(at_rest_first, seconds=60.0),
    "off for 13 minutes": partial(drive_off, seconds=780.0),
    "pause of 20 s": partial(pause, seconds=20.0),
    "gap of 1e5 samples": partial(gap, samples=100_000),
    "outlier of 1e9": partial(outlier, size=1e9),
    "off for 20 minutes, noisy": partial(noise_alone, seconds=1200.0),
    "outlier of 1e4": partial(outlier, size=1e4),
    "outlier of 1e300": partial(outlier, size=1e300),
    "sensor constant for 20 s": partial(sensor_fails, seconds=20.0, kind="constant"),
    "sensor saturated for 20 s": partial(sensor_fails, seconds=20.0, kind="saturated"),
    "sensor stuck for 20 s": partial(sensor_fails, seconds=20.0, kind="stuck"),
    "start in mid-motion": partial(in_mid_motion, seconds=7.3),
}
SHORT: Mapping[str, Callable[..., Disturbed]] = {
    **{name: DISTURBANCES[name] for name in ("pause of 20 s", "outlier of 1e9")},
    "a minute at rest first": DISTURBANCES["a minute at rest first"],
    "off for a minute": partial(drive_off, seconds=60.0),
    "gap of 1e4 samples": partial(gap, samples=10_000),
    "start in mid-motion": DISTURBANCES["start in mid-motion"],
}
