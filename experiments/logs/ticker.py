"""Lines on stderr that say that something goes on, for what takes more than two seconds."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

PATIENCE = 2.0  # s without a word
EVERY = 1.0  # s between words
SELDOM = 15.0  # s between the lines of a file, where none replaces the one before


@contextmanager
def ticker(doing: str) -> Iterator[Callable[[], None]]:
    """Yield what to call at each step; steps and seconds are shown.

    A terminal has one line of it, which is wiped off at the end; a file gets one now and then.
    """
    begun = last = time.monotonic()
    steps, shown = 0, ""

    def tell() -> None:
        nonlocal steps, last, shown
        steps += 1
        now = time.monotonic()
        terminal = sys.stderr.isatty()
        if now - begun < PATIENCE or now - last < (EVERY if terminal else SELDOM):
            return
        last, line = now, f"{doing}: {steps} simulations of the log, {now - begun:.0f} s"
        if terminal:
            shown = line
            print(f"\r{line}", end="", file=sys.stderr, flush=True)
        else:
            print(line, file=sys.stderr, flush=True)

    try:
        yield tell
    finally:
        if shown:
            print("\r" + " " * len(shown) + "\r", end="", file=sys.stderr, flush=True)
