"""What is wrong with an entry, or with where its code is to run."""

from __future__ import annotations

from flexaxis.sim.errors import FlexaxisError


class EntryError(FlexaxisError):
    """An entry cannot be made, read or trusted; one line for each problem.

    Attributes
    ----------
    problems : tuple of str
    """

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems


class CageError(FlexaxisError):
    """The code of an entry cannot be shut in here; nothing of it was run."""
