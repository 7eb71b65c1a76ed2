"""Jitter: time stamps beside an even grid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexaxis.experiments.logs.doubts.doubt import BLUE, ORANGE, Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MUCH = 5.0  # % of a period


def _look(e: Evidence) -> Doubt | None:
    if e.prepared is None:
        return None
    name, percent = "jitter of the time stamps", 100 * e.prepared.jitter
    if percent < MUCH:
        return Doubt(name, percent, "% of T", "ok", "even")
    text = (
        "signals were interpolated; stamps from the controller would be better. If the samples "
        "were taken evenly and only their stamps are late, give the rate in place of the time"
    )
    rate = f"{1 / e.period:.6g}"
    return Doubt(
        name, percent, "% of T", "note", text, f"--rate {rate}", draw=lambda axes: _draw(axes, e)
    )


def _draw(axes: Axes, e: Evidence) -> None:
    """Draw how long the samples were, by their stamps."""
    assert e.raw is not None
    steps = 1e3 * np.diff(e.raw.time)
    axes.hist(steps[steps < 3 * 1e3 * e.period], bins=60, color=BLUE)
    axes.axvline(1e3 * e.period, color=ORANGE)
    axes.set(xlabel="from one stamp to the next [ms]", ylabel="samples")


LOOK = Look(1, _look)
