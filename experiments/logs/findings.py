"""What was found, of whatever kind: how grave it is, words, what to type; and how it is said."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from flexaxis.experiments.running.progress import is_quiet

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


def problems_of(checks: Sequence[Finding], *, met: Collection[str] = ()) -> list[str]:
    """Return a sentence for each problem but those, by their names, that the command meets."""
    problems = (each for each in checks if each.kind == "problem" and each.name not in met)
    return [f"{each.name}: {each.sentence}" for each in problems]


def say_problems(path: Path, checks: Sequence[Finding], *, met: Collection[str] = ()) -> None:
    """Print a line for each problem of a log, as of `problems_of`."""
    for text in problems_of(checks, met=met):
        print(f"✗ {path}: {text}", file=sys.stderr)


@contextmanager
def waiting(doing: str) -> Iterator[None]:
    """Show on a terminal that something goes on, and since when; a file is told nothing."""
    if is_quiet() or not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        shown.add_task(doing, total=None)
        yield
