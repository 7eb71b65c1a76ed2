"""What a look at a log comes to: measured, verdict, words, what to type, and a chart of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from flexaxis.experiments.logs.doubts.evidence import Evidence
    from flexaxis.experiments.reporting.charts import Chart

ROUNDING = 1e-6  # of whatever unit a value has: less is that of numbers in a computer
MARKS = {"problem": "✗", "note": "!", "ok": "✓"}  # of verdicts, in the order of their weight

Verdict = Literal["ok", "note", "problem"]


@dataclass(frozen=True)
class Doubt:
    """One thing that was looked at.

    Attributes
    ----------
    name : str
    value : float or None
        What was measured, in `unit`.
    unit : str
    verdict : {"ok", "note", "problem"}
        Whether it can be trusted, is to be known, or spoils estimates.
    text : str
        In words: what it means.
    command : str
        What to type against it; empty where there is nothing to type.
    remedy : dict
        The same for a program, as for `remedies.remedied`: ``{"highpass": 5.0}``.
    draw : callable or None
        Returns a chart of what was seen, without title and words.
    """

    name: str
    value: float | None
    unit: str
    verdict: Verdict
    text: str
    command: str = ""
    remedy: Mapping[str, Any] = field(default_factory=dict)
    draw: Callable[[], Chart] | None = field(default=None, compare=False, repr=False)

    @property
    def measured(self) -> str:
        """What was measured, with its unit, in words."""
        if self.value is None:
            return ""
        one = abs(self.value) == 1 and self.unit in ("samples", "jumps")
        value = 0.0 if abs(self.value) < ROUNDING else self.value
        return f"{value:.4g} {self.unit[:-1] if one else self.unit}".strip()

    def told(self) -> dict[str, Any]:
        """Return it as plain data, for JSON."""
        return {
            "name": self.name,
            "value": self.value,
            "unit": self.unit,
            "verdict": self.verdict,
            "text": self.text,
            "command": self.command,
            "remedy": dict(self.remedy),
        }


@dataclass(frozen=True)
class Look:
    """How a module of this folder takes part: it has a `LOOK`.

    Attributes
    ----------
    rank : int
        Place among the others in a report.
    at : callable
        From the evidence to a doubt; None where the evidence does not tell.
    """

    rank: int
    at: Callable[[Evidence], Doubt | None]
