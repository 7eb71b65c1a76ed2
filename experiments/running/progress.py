"""Progress on stderr: a bar in a terminal, a line now and then elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from flexaxis.experiments.running.told import is_quiet


@contextmanager
def progress(what: str, total: float) -> Iterator[Callable[[float], None]]:
    """Give a function that is called with the amount done since its last call."""
    from rich.console import Console

    if is_quiet():
        yield lambda amount: None
        return
    console = Console(stderr=True)
    shown = _bar if console.is_terminal else _lines
    with shown(console, what, total) as advance:
        yield advance


@contextmanager
def _bar(console, what: str, total: float) -> Iterator[Callable[[float], None]]:  # type: ignore[no-untyped-def]
    from rich.progress import (
        BarColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as bar:
        task = bar.add_task(what, total=total)
        yield lambda amount: bar.advance(task, amount)


@contextmanager
def _lines(console, what: str, total: float) -> Iterator[Callable[[float], None]]:  # type: ignore[no-untyped-def]
    done, said = 0.0, -1

    def advance(amount: float) -> None:
        nonlocal done, said
        done = min(done + amount, total)  # more may come than was foreseen
        tenth = int(10 * done / total)
        if tenth > said:
            said = tenth
            console.print(f"{what}: {100 * done / total:.0f} %", highlight=False)

    yield advance
