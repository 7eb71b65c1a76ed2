"""Outliers: a few samples of the motion that are far from those before and after them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.sketch import line, points, sketch
from flexaxis.experiments.logs.prepare import unwrapped
from flexaxis.experiments.reporting.charts import Chart

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

OUTLIERS = "outliers of the motion"
WINDOW = 7  # samples, of which up to 3 may be outliers
USUAL = 95.0  # percentile: at most one sample in twenty is an outlier, or it is no exception
FAR = 10.0  # times the usual distance from the median of the window
STEPS = 5.0  # times the usual move within a sample: an end stop is a turn of twice that
SHOWN = 4  # times of outliers that are named


def _look(e: Evidence) -> Doubt | None:
    if e.highpass and e.raw is None:
        return None  # a filter has spread them
    time = e.time if e.raw is None else e.raw.time
    for name, unit in (("angle", "rad"), ("speed", "rad/s")):
        values = getattr(e if e.raw is None else e.raw, name)
        if values is None or (e.raw is None and name == "speed" and e.incremental):
            continue
        there = np.isfinite(values) & (e.usable if e.raw is None else True)
        signal = values[there]
        far = outliers(unwrapped(signal)[0] if name == "angle" else signal)
        if far.any():
            return _doubt(name, unit, time[there], signal, far)
    return Doubt(OUTLIERS, 0.0, "samples", "ok", "none")


def outliers(x: Array) -> Flags:
    """Return which samples (N,) of a motion are none: far out, and back within three samples.

    Hampel's filter: the distance from the median of seven samples, over what it usually is. It is
    0 where the motion has one direction; where it turns, it is less than the axis moves in a
    sample, which decides where the noise is low.

    Examples
    --------
    >>> motion = np.sin(np.arange(1000) / 20)
    >>> motion[500] = 1e6
    >>> np.flatnonzero(outliers(motion)).tolist()
    [500]
    """
    distance, moves = np.abs(x - median_filter(x, WINDOW, mode="nearest")), np.abs(np.diff(x))
    if not distance.any():
        return np.zeros(len(x), bool)
    usual = float(np.percentile(distance, USUAL))
    # of an axis that rests most of the time, the moves count
    step = float(np.percentile(moves[moves > 0], USUAL))
    return distance > max(FAR * usual, STEPS * step)


def _doubt(name: str, unit: str, time: Array, signal: Array, far: Flags) -> Doubt:
    count, worst = int(far.sum()), float(np.abs(signal[far] - np.median(signal)).max())
    at = ", ".join(f"{t:.6g}" for t in time[far][:SHOWN]) + (" …" if count > SHOWN else "")
    one = count == 1
    text = (
        f"the {name} jumps by up to {worst:.3g} {unit} and back within some samples, as no axis "
        f"moves, at {at} s; {'it spoils' if one else 'they spoil'} all estimates, and what else is "
        f"to be doubted cannot be seen. Empty {'that cell' if one else 'those cells'} of the log: "
        "what is missing is not used"
    )
    return Doubt(
        OUTLIERS,
        float(count),
        "sample" if one else "samples",
        "problem",
        text,
        draw=lambda: _draw(time, signal, far, f"{name} [{unit}]"),
    )


def _draw(time: Array, signal: Array, far: Flags, label: str) -> Chart:
    low, high = np.min(signal[~far]), np.max(signal[~far])
    room = 0.2 * (high - low)  # outliers at the edges, or nothing else could be seen
    shown = np.clip(signal[far], low - room, high + room)
    outliers = points(time[far], shown, "outlier (at the edge: further out)")
    return sketch("time [s]", label, line(time[~far], signal[~far]), outliers)


LOOK = Look(8, _look)
