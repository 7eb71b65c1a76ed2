"""Units: which were stated, and which were taken for granted."""

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence

SI = {"time": "s", "angle": "rad", "speed": "rad/s"}


def _look(e: Evidence) -> Doubt | None:
    if e.raw is None:
        return None
    there = [name for name in SI if getattr(e.raw, name) is not None]
    assumed = [name for name in there if name not in e.raw.stated]
    if not assumed:
        return Doubt("units", None, "", "ok", "stated")
    taken = ", ".join(f"{name} for {SI[name]}" for name in assumed)
    text = f"nobody stated them; taken {taken}, which the motion allows"
    return Doubt("units", None, "", "ok", text, "")


LOOK = Look(7, _look)
