"""Jitter: time stamps beside an even grid."""

from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence

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
    return Doubt(name, percent, "% of T", "note", text, f"--rate {rate}")


LOOK = Look(1, _look)
