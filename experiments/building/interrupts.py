"""Ctrl-C: once ends after the cases that are under way, which are kept; twice ends at once.

SIGTERM, by which a queue of jobs or `timeout` ends a command, is the same; it comes also to what
was started in the background, where there may be no Ctrl-C.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
import weakref
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, NoReturn, TypeVar

Item = TypeVar("Item")
Handler = Callable[[int, FrameType | None], None]

AGAIN = 0.01  # s after which a signal is sent again that could not be heeded
_KINDS: dict[signal.Signals, object] = {
    signal.SIGINT: signal.default_int_handler,
    signal.SIGTERM: signal.SIG_DFL,
}
"""What asks a command to end, and how each is handled where nobody has said."""
_FINALIZER = weakref.finalize.__call__.__code__
_ours: list[Handler] = []
_ending = threading.Event()  # from `deaf` on
_flags: list[Any] = [threading.Event()]


def begin(flag: Any = None) -> None:
    """Let work go on until it is asked to end, by `ask` or by an event of another process."""
    _flags[0] = threading.Event() if flag is None else flag


def ask() -> None:
    """Let the work of this process end after the case that is under way."""
    _flags[0].set()


def asked() -> bool:
    """Whether that was asked for: looked at between cases, by who does them."""
    return bool(_flags[0].is_set())


class Interrupts:
    """What was asked by Ctrl-C.

    Attributes
    ----------
    asked : bool
        Whether nothing new is to be begun.
    stop : callable
        Asks what is at work elsewhere to end; what is at work in this process is asked anyway.
    """

    def __init__(self) -> None:
        self.asked = False
        self.stop: Callable[[], object] = lambda: None

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
        self.asked = True
        # Not by print: what is interrupted may be in the middle of one.
        os.write(2, b"\nflexaxis: stopping after the cases that are under way; what is done is "
                    b"kept. Ctrl-C again ends at once\n")  # fmt: skip
        ask()
        self.stop()


@contextmanager
def two_stage() -> Iterator[Interrupts]:
    """Handle Ctrl-C in two stages; in another thread than the main one, leave it as it is."""
    interrupts = Interrupts()
    begin()
    with _handling(interrupts.ask):
        yield interrupts


@contextmanager
def one_stage() -> Iterator[None]:
    """Let Ctrl-C end what is done inside, but never in the middle of compiled code."""
    with _handling(_at_once):
        yield


def _at_once() -> None:
    raise KeyboardInterrupt


@contextmanager
def _handling(react: Callable[[], None]) -> Iterator[None]:
    """Handle Ctrl-C inside, unless this is no main thread, or somebody else does already."""
    put_off: list[threading.Timer] = []

    def handle(number: int, frame: FrameType | None) -> None:
        put_off.clear()
        if _unheard(frame):
            later = threading.Timer(AGAIN, _again, [number])
            later.daemon = True
            later.start()
            put_off.append(later)
        else:
            react()

    before = {kind: signal.getsignal(kind) for kind in _KINDS}
    here = threading.current_thread() is threading.main_thread()
    ours = [kind for kind, usual in _KINDS.items() if here and before[kind] in {usual, *_ours}]
    _ours.append(handle)
    for kind in ours:
        signal.signal(kind, handle)
    try:
        yield
    finally:
        for kind in ours:
            if not _ending.is_set():
                signal.signal(kind, before[kind])
        _ours.remove(handle)
        for later in put_off:  # what comes after this hears it no more
            later.cancel()
        if put_off and not _ending.is_set():
            react()


def _again(number: int) -> None:
    """Send a signal again to the main thread, which wakes it where it waits."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:  # Windows
        signal.raise_signal(number)


def _unheard(frame: FrameType | None) -> bool:
    """Whether an exception would be lost here: in compiled code, or where an object ends.

    Compiled code has called Python for a type; Numba (0.68) goes on with what it did not get, which
    ends the process with a segmentation fault. What a finalizer or `__del__` raises, Python prints
    and forgets.
    """
    while frame is not None:
        if frame.f_code.co_name in {"_numba_unpickle", "__del__"} or frame.f_code is _FINALIZER:
            return True
        frame = frame.f_back
    return False


def deaf(status: int) -> None:
    """Let a command say how it ends: one more Ctrl-C is not heeded, and the next ends it at once.

    For a process that does nothing else after that: no handler of its own is put back in it.
    """
    pressed: list[int] = []

    def handle(number: int, frame: FrameType | None) -> None:
        if pressed:
            os._exit(status)
        pressed.append(number)

    _ending.set()
    _always(handle)


def _always(handle: Handler) -> None:
    """Handle Ctrl-C from now on, where it is heard at all."""
    for kind in _KINDS:
        if signal.getsignal(kind) != signal.SIG_IGN:
            signal.signal(kind, handle)


def leave(status: int) -> NoReturn:
    """End this process after Ctrl-C, without what Python does at its end.

    That takes up to a second, in which another Ctrl-C would change the status.
    """
    _always(lambda number, frame: os._exit(status))
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, OSError, ValueError):  # closed, or nobody reads it
            stream.flush()
    os._exit(status)
