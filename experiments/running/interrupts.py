"""Ctrl-C in two stages: first finish what is at work, then end at once."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TypeVar

Item = TypeVar("Item")

PATIENCE = 0.5
"""For how long a wait may last before it looks whether anything was asked [s]: less than a person
waits for an answer, and rarely enough to cost nothing."""


class Interrupts:
    """What was asked by Ctrl-C.

    Attributes
    ----------
    asked : bool
        Whether nothing new is to be begun.
    at_work : callable
        Gives the number of parts of the work that are under way, for the words.
    """

    def __init__(self) -> None:
        self.asked = False
        self.at_work: Callable[[], int] = lambda: 1

    def until(self, items: Iterable[Item]) -> Iterator[Item]:
        """Yield items until Ctrl-C."""
        for item in items:
            if self.asked:
                return
            yield item

    def tell(self) -> None:
        """Raise KeyboardInterrupt if it was asked for."""
        if self.asked:
            raise KeyboardInterrupt

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Take a Ctrl-C."""
        if self.asked:
            if not _in_numba(frame):
                raise KeyboardInterrupt
            again = threading.Timer(0.01, signal.raise_signal, [number])
            again.daemon = True
            again.start()
            return
        self.asked = True
        count = self.at_work()
        parts = f"{count} part{'s'[: count != 1]} of the work"
        # Not by print: what is interrupted may be in the middle of one.
        os.write(
            2, f"\nflexaxis: stopping; waiting for {parts}. Ctrl-C again ends at once\n".encode()
        )


def _in_numba(frame: FrameType | None) -> bool:
    """Whether compiled code has called Python, for a type; it takes no exception from there.

    Numba (0.68) goes on with what it did not get, which ends the process with a segmentation fault.
    """
    while frame is not None and frame.f_code.co_name != "_numba_unpickle":
        frame = frame.f_back
    return frame is not None


@contextmanager
def two_stage() -> Iterator[Interrupts]:
    """Handle Ctrl-C in two stages; in another thread than the main one, leave it as it is."""
    interrupts = Interrupts()
    usual = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not usual or threading.current_thread() is not threading.main_thread():
        yield interrupts
        return
    signal.signal(signal.SIGINT, interrupts)
    try:
        yield interrupts
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def held_back() -> Iterator[None]:
    """Hold Ctrl-C back while a process may be started, which inherits that: it is for us alone."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
