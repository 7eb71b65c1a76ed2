"""Progress and remarks on stderr, or neither with --quiet."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

PATIENCE = 2.0  # s without a line
QUIET: ContextVar[bool] = ContextVar("quiet", default=False)
"""Whether neither progress nor remarks are wanted."""


@contextmanager
def progress(what: str, total: float) -> Iterator[Callable[[float], None]]:
    """Give a function that is called with the amount done since its last call.

    A terminal shows a bar with the remaining time; elsewhere each tenth is a line, after 2 s.
    """
    from rich.console import Console
    from rich.progress import Progress, TimeElapsedColumn

    console = Console(stderr=True)
    if is_quiet():
        yield lambda amount: None
    elif console.is_terminal:
        columns = (*Progress.get_default_columns(), TimeElapsedColumn())
        with Progress(*columns, console=console, speed_estimate_period=600) as bar:
            task = bar.add_task(what, total=total or 1)
            yield lambda amount: bar.advance(task, amount)
    else:
        yield _lines(what, total or 1)


def _lines(what: str, total: float) -> Callable[[float], None]:
    start, done, tenth = time.monotonic(), 0.0, 0

    def advance(amount: float) -> None:
        nonlocal done, tenth
        done = min(done + amount, total)
        if int(10 * done / total) > tenth:
            tenth, spent = int(10 * done / total), time.monotonic() - start
            if spent > PATIENCE:
                left = spent * (total / done - 1)
                remark(f"{what}: {100 * done / total:.0f} %, {left:.0f} s left")

    return advance


def is_quiet() -> bool:
    """Return whether neither progress nor remarks are wanted."""
    return QUIET.get()


def remark(text: str) -> None:
    """Print what is neither a result nor an error to stderr, unless --quiet."""
    if not is_quiet():
        print(text, file=sys.stderr)
