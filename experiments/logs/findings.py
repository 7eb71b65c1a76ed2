"""What was found, of whatever kind: how grave it is, words, what was measured, what to type."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from flexaxis.experiments.reporting.charts import Chart

ROUNDING = 1e-6  # of whatever unit a value has: less is that of numbers in a computer
MARKS = {"problem": "✗", "note": "!", "ok": "✓"}  # of kinds, in the order of their weight

Kind = Literal["problem", "note", "ok"]


@dataclass(frozen=True)
class Finding:
    """One thing that was found.

    Attributes
    ----------
    kind : {"problem", "note", "ok"}
        Whether it spoils what comes of the log, is to be known, or is as it should be.
    text : str
        In words: what it means.
    name : str
        What was looked at; empty where the text says it.
    value : float or None
        What was measured, in `unit`.
    unit : str
    command : str
        What to type against it; empty where there is nothing to type.
    draw : callable or None
        Returns a chart of what was seen, without title and words.
    """

    kind: Kind
    text: str
    name: str = ""
    value: float | None = None
    unit: str = ""
    command: str = ""
    draw: Callable[[], Chart] | None = field(default=None, compare=False, repr=False)

    @property
    def measured(self) -> str:
        """What was measured, with its unit, in words."""
        if self.value is None:
            return ""
        one = abs(self.value) == 1 and self.unit in ("samples", "jumps")
        value = 0.0 if abs(self.value) < ROUNDING else self.value
        return f"{value:.4g} {self.unit[:-1] if one else self.unit}".strip()

    @property
    def sentence(self) -> str:
        """Its words, with what to type."""
        return f"{self.text}. Type: {self.command}" if self.command else self.text

    def told(self) -> dict[str, Any]:
        """Return it as plain data, for JSON."""
        names = ("name", "value", "unit", "text", "command")
        return {name: getattr(self, name) for name in names} | {"verdict": self.kind}


def ordered(found: Iterable[Finding]) -> list[Finding]:
    """Return findings, the gravest first."""
    order = [*MARKS]
    return sorted(found, key=lambda each: order.index(each.kind))


def texts_of(found: Sequence[Finding], *kinds: Kind) -> list[str]:
    """Return the words of findings of some kinds."""
    return [each.text for each in found if each.kind in kinds]
