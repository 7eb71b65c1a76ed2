"""Clipping: a torque that stands at its extreme value."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.sketch import line, points, sketch
from flexaxis.experiments.reporting.charts import Chart

Flags = NDArray[np.bool_]

RUN = 3  # samples in a row
LEVELS = 3  # values: a torque that has no more of them switches, and is not clipped
MUCH = 1.0  # % of the samples


def _look(e: Evidence) -> Doubt | None:
    if e.highpass or (e.raw is None and e.smooth):
        return None  # a filter has blurred what stood still
    u = e.torque if e.raw is None else e.raw.torque
    u = u[np.isfinite(u)]
    name, stuck = "clipping of the torque", at_limit(u)
    share = 100 * float(stuck.mean())
    if share == 0 or len(np.unique(u[:10_000])) <= LEVELS:
        return Doubt(name, 0.0, "%", "ok", "none")
    text = (
        f"the torque stands at its limit, {np.abs(u).max():.4g}: harmless if that is what acted; "
        "if it is what was asked for, or the sensor's end, log what acted, or excite less"
    )
    verdict = "note" if share < MUCH else "problem"
    return Doubt(name, share, "%", verdict, text, draw=lambda: _draw(u, stuck))  # type: ignore[arg-type]


def at_limit(u: NDArray[np.float64]) -> Flags:
    """Return where a signal stands at its highest or lowest value for three or more samples."""
    stuck = np.zeros(len(u), bool)
    for extreme in (u.max(), u.min()):
        run = np.convolve(u == extreme, np.ones(RUN), "valid") > RUN - 0.5
        for shift in range(RUN):
            stuck[shift : len(u) - RUN + 1 + shift] |= run
    return stuck


def _draw(u: NDArray[np.float64], stuck: Flags) -> Chart:
    first = int(np.argmax(stuck))
    piece = slice(max(first - 100, 0), first + 300)
    k = np.arange(len(u))[piece]
    at_extreme = points(k[stuck[piece]], u[piece][stuck[piece]], "at its extreme")
    return sketch("sample", "torque [as logged]", line(k, u[piece]), at_extreme)


LOOK = Look(4, _look)
