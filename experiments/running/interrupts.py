"""Ctrl-C: once stops the work and keeps what is done, twice ends at once.

SIGTERM, by which a queue of jobs or `timeout` ends a command, is the same; it comes also to what
was started in the background, where there may be no Ctrl-C.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn, TypeVar

from flexaxis.experiments.building.inherited import STOP
from flexaxis.experiments.running import stopping
from flexaxis.experiments.running.stopping import patient

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
    over : bool
        Whether what Ctrl-C is for has ended.
    """

    def __init__(self) -> None:
        self.asked = False
        self.stop: Callable[[], None] = lambda: None
        self._until = float("inf")
        self.over = False

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

    def ask(self) -> None:
        """Take a Ctrl-C."""
        self.tell()
        self.asked, self._until = True, time.monotonic() + GRACE
        # Not by print: what is interrupted may be in the middle of one.
        os.write(2, b"\nflexaxis: stopping; what is done is kept. Ctrl-C again ends at once\n")
        self.stop()
        if STOP is not None and stopping.heed():
            signal.raise_signal(STOP)  # which comes again where it is lost
        else:
            stopping.ask()


def _at_once() -> None:
    raise KeyboardInterrupt


_endings: list[Callable[[int, FrameType | None], None]] = []
"""The handlers of every `one_stage` that is open: a signal that comes late is for no other."""
_KINDS: dict[signal.Signals, object] = {
    signal.SIGINT: signal.default_int_handler,
    signal.SIGTERM: signal.SIG_DFL,
}
"""What asks a command to end, and how each is handled where nobody has said."""


@contextmanager
def _handling(react: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Handle Ctrl-C inside, unless this is no main thread, or somebody else does already."""
    before = {kind: signal.getsignal(kind) for kind in _KINDS}
    here = threading.current_thread() is threading.main_thread()
    ours = [kind for kind, usual in _KINDS.items() if here and before[kind] in {usual, *_endings}]
    for kind in ours:
        signal.signal(kind, react)
    try:
        yield
    finally:
        for kind in ours:
            signal.signal(kind, before[kind])


@contextmanager
def two_stage() -> Iterator[Interrupts]:
    """Handle Ctrl-C in two stages; in another thread than the main one, leave it as it is."""
    interrupts = Interrupts()
    # Of what was before, a signal may still come; of what is around this, it is meant for this too.
    around = stopping.begin(lambda: interrupts.asked or around())
    with _handling(patient(interrupts.ask, lambda: not interrupts.over)):
        try:
            yield interrupts
        finally:
            interrupts.over = True
            stopping.begin(around)


@contextmanager
def one_stage() -> Iterator[None]:
    """Let Ctrl-C end what is done inside, but never in the middle of compiled code."""
    over = threading.Event()
    ending = patient(_at_once, lambda: not over.is_set())
    with _handling(ending), _dropped_in_silence():
        _endings.append(ending)
        try:
            yield
        finally:
            over.set()
            _endings.remove(ending)


@contextmanager
def _dropped_in_silence() -> Iterator[None]:
    """Say nothing of a Ctrl-C that Python drops, for it comes again."""
    usual = sys.unraisablehook

    def drop(what: sys.UnraisableHookArgs) -> None:
        if not issubclass(what.exc_type, KeyboardInterrupt | stopping.Stopped):
            usual(what)

    sys.unraisablehook = drop
    try:
        yield
    finally:
        sys.unraisablehook = usual


def threads_left() -> bool:
    """Whether there are threads for whose end Python waits, such as an estimator may have begun."""
    others = set(threading.enumerate()) - {threading.main_thread(), threading.current_thread()}
    return any(not thread.daemon for thread in others)


def leave(status: int) -> NoReturn:
    """End this process after Ctrl-C, without what Python does at its end.

    That takes up to a second, in which another Ctrl-C would change the status; and for ever, where
    threads are left that do not end.
    """
    for kind in _KINDS:
        signal.signal(kind, lambda number, frame: os._exit(status))
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, OSError, ValueError):  # closed, or nobody reads it
            stream.flush()
    os._exit(status)
