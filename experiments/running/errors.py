"""What can go wrong between a plan and its results."""

from __future__ import annotations

from flexaxis.sim.errors import FlexaxisError


class StudyError(FlexaxisError):
    """A study is wrong, or cannot go on; the message has one line for each problem."""
