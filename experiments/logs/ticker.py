"""A line on stderr that says that something goes on, for what takes more than two seconds."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

PATIENCE = 2.0  # s without a word
EVERY = 1.0  # s between words


@contextmanager
def ticker(doing: str) -> Iterator[Callable[[], None]]:
    """Yield what to call at each step; steps and seconds are shown, and wiped off at the end."""
    begun = last = time.monotonic()
    steps, shown = 0, ""

    def tell() -> None:
        nonlocal steps, last, shown
        steps += 1
        now = time.monotonic()
        if sys.stderr.isatty() and now - begun > PATIENCE and now - last > EVERY:
            shown = f"{doing}: {steps} simulations of the log, {now - begun:.0f} s"
            print(f"\r{shown}", end="", file=sys.stderr, flush=True)
            last = now

    try:
        yield tell
    finally:
        if shown:
            print("\r" + " " * len(shown) + "\r", end="", file=sys.stderr, flush=True)
