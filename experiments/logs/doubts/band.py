"""The band of the excitation: the frequencies at which the torque has its power."""

from __future__ import annotations

import numpy as np

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.sketch import line, sketch
from flexaxis.experiments.reporting.charts import Chart


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
    return Doubt(name, high, "Hz", "note", text, draw=lambda: _draw(e))


def _draw(e: Evidence) -> Chart:
    s = e.spectra
    spectrum = line(s.frequency[1:], np.sqrt(s.torque[1:]))
    return sketch("frequency [Hz], up to half the rate", "torque [per √Hz]", spectrum, y_log=True)


LOOK = Look(13, _look)
