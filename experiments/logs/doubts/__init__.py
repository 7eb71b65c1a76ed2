"""What is to be doubted of a log: nine looks, in the order in which one hides another.

In comes `evidence` (the log on its even grid, its spectra, how it was sampled), out go findings:
how it was sampled (`sampled`), how the torque moves the axis (`moved`), what the torque is
(`torque_kind`).
"""

from __future__ import annotations

from flexaxis.experiments.logs.doubts import moved, sampled, torque_kind
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.findings import Finding

SAMPLED = (
    sampled.time_stamps,
    sampled.wrapping,
    sampled.clipping,
    sampled.clocks,
    sampled.units,
    moved.outliers_of,
)
MOVED = (torque_kind.look, moved.sign, moved.dry_friction)
"""Looks at how the torque moves the axis, which outliers hide."""


def examine(evidence: Evidence) -> tuple[Finding, ...]:
    """Return everything that was looked at."""
    found = [look(evidence) for look in SAMPLED]
    if found[-1] is None or found[-1].kind == "ok":
        found += [look(evidence) for look in MOVED]
    return tuple(each for each in found if each is not None)
