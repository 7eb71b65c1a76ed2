"""Findings on a log: their weight, their words and what to type; and the error of a useless log."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from flexaxis.sim.errors import FlexaxisError

Kind = Literal["problem", "note", "info", "ok"]
MARKS: dict[Kind, str] = {"problem": "✗", "note": "!", "info": "·", "ok": "✓"}
"""Marks of kinds, in the order of their weight."""


class LogError(FlexaxisError):
    """A log cannot be read or used; the message gives the reason and the next step."""


@dataclass(frozen=True)
class Finding:
    """A sentence on a log or its estimates.

    Attributes
    ----------
    kind : {"problem", "note", "info", "ok"}
        Whether it spoils estimates, should be known, is plain information, or is a passed check.
    text : str
    name : str
        The check; empty where the text says it.
    command : str
        What to type against it, or empty.
    """

    kind: Kind
    text: str
    name: str = ""
    command: str = ""

    @property
    def sentence(self) -> str:
        """The text with its name and with what to type."""
        name = f"{self.name}: " if self.name else ""
        return f"{name}{self.text}" + (f". Type: {self.command}" if self.command else "")


def ordered(every: Iterable[Finding]) -> list[Finding]:
    """Return findings, the gravest first."""
    return sorted(every, key=lambda one: [*MARKS].index(one.kind))


def texts_of(every: Iterable[Finding], *kinds: Kind) -> list[str]:
    """Return the sentences of findings of some kinds."""
    return [one.sentence for one in every if one.kind in kinds]
