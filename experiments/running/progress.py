"""Progress and remarks on stderr, or neither with --quiet."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial

QUIET: ContextVar[bool] = ContextVar("quiet", default=False)
"""Whether neither progress nor remarks are wanted."""
LINE: ContextVar[str] = ContextVar("line", default="")
"""The command line that does what is under way; empty in Python."""


@contextmanager
def progress(what: str, total: float) -> Iterator[Callable[[float], None]]:
    """Give a function that is called with the amount done since its last call.

    A terminal shows a bar with the remaining time until it is done; elsewhere nothing is shown.
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
    """Print a remark to stderr, unless --quiet."""
    if not QUIET.get():
        print(text, file=sys.stderr)
