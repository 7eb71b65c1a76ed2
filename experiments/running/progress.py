"""Show progress and remarks on stderr, unless the option --quiet is set."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial

QUIET: ContextVar[bool] = ContextVar("quiet", default=False)
"""Whether to suppress the progress bar and remarks."""
LINE: ContextVar[str] = ContextVar("line", default="")
"""Command line of the current command; empty if flexaxis is called from Python code."""


@contextmanager
def progress(what: str, total: float) -> Iterator[Callable[[float], None]]:
    """Show a progress bar, and yield a function that advances the bar by a given amount.

    The progress bar with the remaining time appears only if stderr is a terminal.
    """
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    hidden = not console.is_terminal or QUIET.get()
    with Progress(
        console=console, speed_estimate_period=600, transient=True, disable=hidden
    ) as bar:
        yield partial(bar.advance, bar.add_task(what, total=total or 1))


def remark(text: str) -> None:
    """Print a remark to stderr, unless the option --quiet is set."""
    if not QUIET.get():
        print(text, file=sys.stderr)
