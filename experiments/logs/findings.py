"""Findings on a log: their weight, their words and what to type; and the error of a useless log."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from flexaxis.sim.errors import FlexaxisError

ROUNDING = 1e-6  # of whatever unit a value has: less is that of numbers in a computer
Kind = Literal["problem", "note", "info", "ok"]
MARKS: dict[Kind, str] = {"problem": "✗", "note": "!", "info": "·", "ok": "✓"}
"""Marks of kinds, in the order of their weight."""


class LogError(FlexaxisError):
    """A log cannot be read or used; the message gives the reason and the next step."""


@dataclass(frozen=True)
class Finding:
    """One thing that was found.

    Attributes
    ----------
    kind : {"problem", "note", "info", "ok"}
        Whether it spoils estimates, should be known, is plain information, or a passed check.
    text : str
        What it means, in words.
    name : str
        What was looked at; empty where the text says it.
    value : float or None
        What was measured, in `unit`.
    unit : str
    command : str
        What to type against it; empty where nothing is to be done.
    """

    kind: Kind
    text: str
    name: str = ""
    value: float | None = None
    unit: str = ""
    command: str = ""

    @property
    def measured(self) -> str:
        """What was measured, with its unit, in words."""
        if self.value is None:
            return ""
        return f"{0.0 if abs(self.value) < ROUNDING else self.value:.4g} {self.unit}".strip()

    @property
    def sentence(self) -> str:
        """Its words, with what to type."""
        name = f"{self.name}: " if self.name else ""
        return f"{name}{self.text}" + (f". Type: {self.command}" if self.command else "")


def ordered(every: Iterable[Finding]) -> list[Finding]:
    """Return findings, the gravest first."""
    return sorted(every, key=lambda one: [*MARKS].index(one.kind))


def texts_of(every: Iterable[Finding], *kinds: Kind) -> list[str]:
    """Return the sentences of findings of some kinds."""
    return [one.sentence for one in every if one.kind in kinds]
