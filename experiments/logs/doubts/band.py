"""The band of the excitation: the frequencies at which the torque has its power."""

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence


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
    return Doubt(name, high, "Hz", "note", text)


LOOK = Look(13, _look)
