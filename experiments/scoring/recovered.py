"""What an estimate is worth to the controller, of what a fault costs it in tracking."""

from __future__ import annotations

from collections.abc import Mapping

from flexaxis.experiments.scoring.scores import Track, finite

COSTS = 0.2
"""By which part the fault has to raise the tracking error for the score to be defined."""

PARTS: Mapping[str, str] = {
    "without_fault": "rad", "frozen": "rad", "told": "rad", "estimated": "rad", "limited": ""
}  # fmt: skip
"""What a row holds of the loops, with units."""


def recovered_of(track: Track, i: int) -> float | None:
    """Return what is recovered of the cost of the fault [%]; the same for each parameter."""
    return recovered(track.tracking, "estimated")


def recovered_told_of(track: Track, i: int) -> float | None:
    """Return the same of whoever is told the truth [%]."""
    return recovered(track.tracking, "told")


def recovered(tracking: Mapping[str, float] | None, whose: str) -> float | None:
    """Return 100 (frozen − whose)/(frozen − without_fault), where the fault costs enough.

    Examples
    --------
    >>> recovered({"without_fault": 1.0, "frozen": 2.0, "estimated": 1.5}, "estimated")
    50.0
    >>> recovered({"without_fault": 1.0, "frozen": 1.1, "estimated": 1.0}, "estimated")
    """
    if tracking is None:
        return None
    best, worst = tracking["without_fault"], tracking["frozen"]
    if worst < (1 + COSTS) * best:
        return None
    return finite(100 * (worst - tracking[whose]) / (worst - best))
