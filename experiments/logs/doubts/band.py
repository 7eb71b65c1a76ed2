"""The band of the excitation: the frequencies at which the torque has its power."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexaxis.experiments.logs.doubts.doubt import BLUE, Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def _look(e: Evidence) -> Doubt:
    low, high = e.band
    name, text = (
        "band of the excitation",
        f"98 % of the torque lies within {low:.3g} … {high:.3g} Hz",
    )
    if high * e.period < 0.25:
        return Doubt(name, high, "Hz", "ok", text)
    text += (
        ": up to more than half of what the rate can show. What a model of samples makes of it "
        "depends on how the torque runs between them; sample faster"
    )
    return Doubt(name, high, "Hz", "note", text, draw=lambda axes: _draw(axes, e))


def _draw(axes: Axes, e: Evidence) -> None:
    s = e.spectra
    axes.semilogy(s.frequency[1:], np.sqrt(s.torque[1:]), color=BLUE, lw=0.8)
    axes.set(xlabel="frequency [Hz], up to half the rate", ylabel="torque [per √Hz]")


LOOK = Look(13, _look)
