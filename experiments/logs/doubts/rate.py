"""The rate, the length of a log, and whether its angle was unwrapped."""

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence


def _look(e: Evidence) -> Doubt:
    text = f"{len(e.time)} samples, {len(e.time) * e.period:.4g} s"
    return Doubt("sampling rate", 1 / e.period, "Hz", "ok", text)


LOOK = Look(0, _look)
