"""What commands say on the standard error of a log that they read: problems, and to wait."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.running.progress import is_quiet


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
