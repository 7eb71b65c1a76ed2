"""Units: which were stated, and which were taken for granted."""

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.nonsense import FAST, SI, other_units, usual_speed

SECONDS = 0.02  # s: if smaller steps were of ms, the log would be one of more than 50 kHz


def _look(e: Evidence) -> Doubt | None:
    if e.raw is None:
        return None
    there = [name for name in SI if getattr(e.raw, name) is not None]
    assumed = [name for name in there if name not in e.raw.stated]
    if e.period < SECONDS and "time" in assumed:
        assumed.remove("time")
    if not assumed:
        return Doubt("units", None, "", "ok", "stated, or beyond doubt")
    for name in ("angle", "speed"):
        usual = usual_speed(e.raw, name)
        if usual is not None and usual > FAST:
            text = (
                f"nobody stated them, and the motor would turn at {usual:.3g} rad/s, as spindles "
                f"do but hardly an axis: {other_units(name)}"
            )
            return Doubt("units", usual, "rad/s", "problem", text, f"--unit {name}=UNIT")
    taken = ", ".join(f"{name} for {SI[name]}" for name in assumed)
    options = " ".join(f"--unit {name}={SI[name]}" for name in assumed)
    text = (
        f"nobody stated them; taken {taken}. No log tells whether that is so, and all estimates "
        "would be wrong by the factor of the unit. State them, in these units or others"
    )
    return Doubt("units", None, "", "note", text, options)


LOOK = Look(7, _look)
