"""What commands say on the standard error of a log that they read: problems, and to wait."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from flexaxis.experiments.logs.doubts.doubt import Doubt
from flexaxis.experiments.running.told import is_quiet


def problems_of(checks: Sequence[Doubt], *, met: Collection[str] = ()) -> list[str]:
    """Return a sentence for each problem.

    Parameters
    ----------
    checks : sequence of Doubt
    met : collection of str
        Remedies that the command takes by itself, such as ``highpass``.
    """
    found = []
    for check in checks:
        if check.verdict == "problem" and not set(met) & set(check.remedy):
            advice = f". Type: {check.command}" if check.command else ""
            found.append(f"{check.name}: {check.text}{advice}")
    return found


def say_problems(path: Path, checks: Sequence[Doubt], *, met: Collection[str] = ()) -> None:
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
