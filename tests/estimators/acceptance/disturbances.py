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


def at_rest_first(axis, seconds, **options) -> Disturbed:
    """The drive is off at first: torque and speed are exactly zero."""
    run = simulate(axis, AFTER, **options)
    N = run.samples(seconds)
    u, y, clean = (np.r_[np.zeros(N), signal] for signal in (run.u, run.y, run.clean))
    theta = np.vstack([np.repeat(run.theta[:1], N, axis=0), run.theta])
    return _whole(Run(u, y, clean, theta, run.period), (0, N))


def still(axis, seconds, why, **options) -> Disturbed:
    """
    The axis stands still, from a second after the beginning on.

    With "pause" the reference is held; with "off" the drive is off, and all is exactly zero.
    """
    span = BEFORE, BEFORE + seconds
    run = simulate(axis, span[1] + AFTER, **{why: span}, **options)
    return _whole(run, (run.samples(span[0]), run.samples(span[1])))


def gap(axis, samples, **options) -> Disturbed:
    """Outputs are missing while the axis goes on."""
    seconds = samples * options.get("period", 0.005)
    run = simulate(axis, BEFORE + seconds + AFTER, **options)
    first = run.samples(BEFORE)
    valid = np.ones(len(run.u), bool)
    valid[first : first + samples] = False
    y = np.where(valid, run.y, 0.0)
    return Disturbed(replace(run, y=y), valid, (first, first + samples))


def outlier(axis, size, **options) -> Disturbed:
    """One output is nonsense."""
    run = simulate(axis, BEFORE + AFTER, **options)
    y = run.y.copy()
    y[run.samples(BEFORE)] = size
    return _whole(replace(run, y=y))


def in_mid_motion(axis, seconds, **options) -> Disturbed:
    """The estimator is started while the axis moves."""
    run = simulate(axis, seconds + AFTER, **options)
    N = run.samples(seconds)
    parts = (signal[N:] for signal in (run.u, run.y, run.clean, run.theta))
    return _whole(Run(*parts, period=run.period))


DISTURBANCES: Mapping[str, Callable[..., Disturbed]] = {
    "pause of 20 s": partial(still, why="pause", seconds=20.0),
    "outlier of 1e9": partial(outlier, size=1e9),
    "a minute at rest first": partial(at_rest_first, seconds=60.0),
    "off for a minute": partial(still, why="off", seconds=60.0),
    "gap of 1e4 samples": partial(gap, samples=10_000),
    "start in mid-motion": partial(in_mid_motion, seconds=7.3),
}
