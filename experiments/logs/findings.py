"""What was found, of whatever kind: how grave it is, words, what to type; and how it is said."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from flexaxis.experiments.running.progress import is_quiet

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


def lightened(checks: Iterable[Finding], met: Collection[str]) -> tuple[Finding, ...]:
    """Return findings in which problems are notes that, by their names, the next command meets."""
    return tuple(
        replace(each, kind="note") if each.kind == "problem" and each.name in met else each
        for each in checks
    )


def problems_of(checks: Sequence[Finding], *, met: Collection[str] = ()) -> list[str]:
    """Return a sentence for each problem but those, by their names, that the command meets."""
    problems = (each for each in lightened(checks, met) if each.kind == "problem")
    return [f"{each.name}: {each.sentence}" for each in problems]


def say_problems(path: Path, checks: Sequence[Finding], *, met: Collection[str] = ()) -> None:
    """Print a line for each problem of a log, as of `problems_of`."""
    for text in problems_of(checks, met=met):
        print(f"✗ {path}: {text}", file=sys.stderr)


def tell(found: Iterable[Finding]) -> None:
    """Print a line for each, with its mark."""
    from rich.console import Console

    console = Console()
    for each in found:
        style = "yellow" if each.kind == "problem" else None
        text = f"{MARKS[each.kind]} {each.text}"
        console.print(text, style=style, markup=False, highlight=False, soft_wrap=True)


def show(heads: Sequence[str], rows: Iterable[Any]) -> None:
    """Print rows of a page's table; a dash there is nothing here."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(*heads, box=None, pad_edge=False)
    for row in rows:
        table.add_row(*(escape(cell.text.replace("–", "")) for cell in row.cells))
    Console().print(table)


def waiting(doing: str) -> AbstractContextManager[Any]:
    """Show on a terminal that something goes on; a file is told nothing."""
    from rich.console import Console

    return nullcontext() if is_quiet() else Console(stderr=True).status(doing)
