"""Ctrl-C: once stops the work and keeps what is done, twice ends at once."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TypeVar

from flexaxis.experiments.running import stopping

Item = TypeVar("Item")

PATIENCE = 0.5
"""For how long a wait may last before it looks whether anything was asked [s]: less than a person
waits for an answer, and rarely enough to cost nothing."""
GRACE = 1.5
"""How long what is at work may take to stop before it is lost [s]: much longer than it needs, and
as long as a person believes that a key was heard."""


class Interrupts:
    """What was asked by Ctrl-C.

    Attributes
    ----------
    asked : bool
        Whether nothing new is to be begun.
    stop : callable
        Stops what is at work elsewhere; what is at work in this process is stopped anyway.
    """

    def __init__(self) -> None:
        self.asked = False
        self.stop: Callable[[], None] = lambda: None
        self._until = float("inf")

    @property
    def overdue(self) -> bool:
        """Whether what was at work has had its time to stop."""
        return time.monotonic() > self._until

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
            at_once(number, frame)
            return
        self.asked, self._until = True, time.monotonic() + GRACE
        # Not by print: what is interrupted may be in the middle of one.
        os.write(2, b"\nflexaxis: stopping; what is done is kept. Ctrl-C again ends at once\n")
        self.stop()
        stopping.ask(frame)


def at_once(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt as soon as that can be done without a crash."""
    if stopping.in_numba(frame):
        stopping.later(number)
        return
    raise KeyboardInterrupt


_OURS = (signal.default_int_handler, at_once)


@contextmanager
def _handling(handler: Callable[[int, FrameType | None], None]) -> Iterator[bool]:
    """Handle Ctrl-C inside, unless this is no main thread, or somebody else does already."""
    before = signal.getsignal(signal.SIGINT)
    if before not in _OURS or threading.current_thread() is not threading.main_thread():
        yield False
        return
    signal.signal(signal.SIGINT, handler)
    try:
        yield True
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def two_stage() -> Iterator[Interrupts]:
    """Handle Ctrl-C in two stages; in another thread than the main one, leave it as it is."""
    interrupts = Interrupts()
    with _handling(interrupts):
        try:
            yield interrupts
        finally:
            stopping.forget()


@contextmanager
def one_stage() -> Iterator[None]:
    """Let Ctrl-C end what is done inside, but never in the middle of compiled code."""
    with _handling(at_once):
        yield


@contextmanager
def held_back() -> Iterator[None]:
    """Hold Ctrl-C back while a process may be started, which inherits that: it is for us alone.

    So is what tells a worker to stop, until it knows what to do then.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    kinds = {signal.SIGINT, *([stopping.STOP] if stopping.STOP else [])}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, kinds)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
