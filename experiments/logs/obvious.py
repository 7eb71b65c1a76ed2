"""What one would try next on an identification that something speaks against, tried at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from flexaxis.experiments.logs.doubts.looking import doubts_of
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identify import Identification
from flexaxis.sim.record import Record


def advised_corner(record: Record) -> float | None:
    """Return the corner [Hz] that the doubts of a record advise a high-pass of, if any does."""
    corners = (doubt.remedy.get("highpass") for doubt in doubts_of(record))
    return next((float(corner) for corner in corners if corner is not None), None)


def with_the_obvious(
    record: Record, found: Identification, again: Callable[[float], Identification]
) -> Identification:
    """Return an identification, or that with residuals filtered where less speaks against it.

    A smooth torque and friction are tried by `identify` itself; drift is what is left.

    Parameters
    ----------
    record : Record
    found : Identification
    again : callable
        Identifies again, with residuals below a corner [Hz] left out.
    """
    filtered = found.axis.highpass is not None or "highpass" in record.versions
    corner = None if filtered or not found.warnings else advised_corner(record)
    if corner is None:
        return found
    try:
        other = again(corner)
    except LogError as error:
        return _remarked(found, f"--highpass {corner:g} was tried as well, and failed: {error}")
    if len(other.warnings) >= len(found.warnings):
        return _remarked(
            found, f"--highpass {corner:g} was tried as well: no less speaks against the result"
        )
    return _remarked(
        other,
        f"the motion drifts: residuals below {corner:g} Hz were left out, as with --highpass "
        f"{corner:g}, since without: {'; '.join(found.warnings)}",
    )


def _remarked(found: Identification, text: str) -> Identification:
    verdict = replace(found.verdict, remarks=(*found.verdict.remarks, text))
    return replace(found, verdict=verdict)
