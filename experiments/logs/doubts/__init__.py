"""What is to be doubted of a log: nine looks, in the order in which one hides another."""

from __future__ import annotations

from flexaxis.experiments.logs.doubts import moved, sampled, torque_kind
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.findings import Finding
from flexaxis.sim.record import Record

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


def doubts_of(record: Record) -> tuple[Finding, ...]:
    """Return what is to be doubted of a record, and what is not, before any estimator runs.

    What only the log told from which it was imported (jitter, clipping, wrapping) is on the page
    of the import, and not here.

    Examples
    --------
    >>> problems = [d for d in doubts_of(record) if d.kind == "problem"]  # doctest: +SKIP
    """
    return examine(Evidence(record))


def examine(evidence: Evidence) -> tuple[Finding, ...]:
    """Return everything that was looked at."""
    if evidence.still:
        text = "torque or motion are constant: nothing can be learnt from this log but its noise"
        seconds = len(evidence.time) * evidence.period
        return (Finding("problem", text, "motion", seconds, "s"),)
    found = [look(evidence) for look in SAMPLED]
    if found[-1] is None or found[-1].kind == "ok":
        found += [look(evidence) for look in MOVED]
    return tuple(each for each in found if each is not None)
