"""Findings: how grave one is, its words, what to type against it; and how they are printed."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from flexaxis.experiments.reporting.tables import Table
from flexaxis.experiments.running.progress import is_quiet

ROUNDING = 1e-6  # of whatever unit a value has: less is that of numbers in a computer
MARKS = {"problem": "✗", "note": "!", "info": "·", "ok": "✓"}
"""Marks of kinds, in the order of their weight."""

Kind = Literal["problem", "note", "info", "ok"]


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

    def told(self) -> dict[str, Any]:
        """Return it as plain data, for JSON."""
        content = asdict(self)
        return content | {"verdict": content.pop("kind")}


def ordered(every: Iterable[Finding]) -> list[Finding]:
    """Return findings, the gravest first."""
    return sorted(every, key=lambda one: [*MARKS].index(one.kind))


def texts_of(every: Iterable[Finding], *kinds: Kind) -> list[str]:
    """Return the sentences of findings of some kinds."""
    return [one.sentence for one in every if one.kind in kinds]


def say_problems(path: Path, checks: Iterable[Finding]) -> None:
    """Print a line for each problem of a log."""
    for text in texts_of(checks, "problem"):
        print(f"✗ {path}: {text}", file=sys.stderr)


def tell(every: Iterable[Finding]) -> None:
    """Print a line for each, with its mark."""
    from rich.console import Console

    console = Console()
    for one in every:
        style = {"problem": "red", "note": "yellow"}.get(one.kind)
        text = f"{MARKS[one.kind]} {one.sentence}"
        console.print(text, style=style, markup=False, highlight=False, soft_wrap=True)


def show(table: Table) -> None:
    """Print a table."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table as Lines

    lines = Lines(*table.heads, box=None, pad_edge=False)
    for _, cells in table.rows:
        lines.add_row(*(escape(cell.text) for cell in cells))
    Console().print(lines)


def waiting(doing: str) -> AbstractContextManager[Any]:
    """Show on a terminal that something goes on; nothing in a file."""
    from rich.console import Console

    return nullcontext() if is_quiet() else Console(stderr=True).status(doing)


def sentences(every: Sequence[Finding]) -> str:
    """Return findings as one text."""
    return " ".join(f"{one.sentence.rstrip('.')}." for one in every)
