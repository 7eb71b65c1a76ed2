"""Gaps: samples that are not in the log."""

from __future__ import annotations

import numpy as np

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.sketch import LOG, sketch
from flexaxis.experiments.reporting.charts import Chart, Line

MUCH = 20.0  # %: where so much is missing, what there is cannot be trusted either


def _look(e: Evidence) -> Doubt:
    name, missing = "missing samples", 100 * float(np.mean(~e.usable))
    edges = np.flatnonzero(np.diff(np.r_[1, e.usable, 1]))
    gaps = len(edges) // 2
    if not gaps:
        return Doubt(name, 0.0, "%", "ok", "none")
    longest = float((edges[1::2] - edges[::2]).max() * e.period)
    text = f"{gaps} gap{'s' * (gaps > 1)}, the longest {longest:.3g} s; marked, not updated on"
    infinite = _infinite(e)
    if infinite:
        text += f". Infinite, and no numbers: {infinite}; ask what wrote the log"
    return Doubt(
        name,
        missing,
        "%",
        "note" if missing < MUCH else "problem",
        text,
        draw=lambda: _draw(e),
    )


def _infinite(e: Evidence) -> str:
    """Return in words which signals of a log have infinite values, and how many."""
    there = {n: getattr(e.raw, n, None) for n in ("torque", "angle", "speed", "load_angle")}
    counts = {n: int(np.isinf(values).sum()) for n, values in there.items() if values is not None}
    return ", ".join(
        f"{n} in {count} sample{'s' * (count > 1)}" for n, count in counts.items() if count
    )


def _draw(e: Evidence) -> Chart:
    missing = ~e.usable
    edges = np.unique(np.r_[0, np.flatnonzero(np.diff(missing)) + 1, len(missing) - 1])
    steps = Line(who=LOG, x=np.asarray(e.time)[edges], y=1.0 * missing[edges], kind="steps")
    return sketch("time [s]", "missing (1) or there (0)", steps)


LOOK = Look(2, _look)
