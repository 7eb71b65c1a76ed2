"""Work that can be stopped in the middle: what is done of it is kept.

The work of a process is a unit of cases, in its main thread. A stop is raised there, wherever it
is, by a signal: Ctrl-C itself where the work is in the process that has it, `STOP` in a worker.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType

from flexaxis.experiments.building.inherited import STOP

AGAIN = 0.01  # s after which a signal is sent again that could not be heeded


class Stopped(BaseException):
    """The work is stopped; not an `Exception`, so that no `except Exception` holds it up."""


class _State:
    """What a process knows of a stop.

    Attributes
    ----------
    asked : bool
        Whether all work is to stop, also what is still to come.
    able : bool
        Whether work is under way that may be left where it is.
    """

    asked = able = False


_state = _State()


def ask() -> None:
    """Stop the work of this process; to be called in its main thread, by the handler of a signal.

    Raises
    ------
    Stopped
        If work is under way; else it will end as soon as it begins.
    """
    _state.asked = True
    if not _state.able:
        return
    _state.able = False  # raised once
    raise Stopped


def forget() -> None:
    """Let work begin again."""
    _state.asked = False


def check() -> None:
    """Raise Stopped if that was asked for: something may have held it up when it was raised."""
    if _state.asked:
        raise Stopped


class stoppable:
    """Do work inside that may be left where it is; a stop ends the block, and no more.

    Inside another such block, it is the inner one that ends, and the outer one goes on. A class
    and no generator: a stop that comes on the way in or out is then no error but a `Stopped`.
    """

    def __enter__(self) -> None:
        self._before = _state.able
        _state.able = threading.current_thread() is threading.main_thread()

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> bool:
        stopped = kind is not None and issubclass(kind, Stopped)
        _state.able = self._before and not stopped  # raised once
        return stopped


def heed() -> None:
    """Let `STOP` stop the work of this process."""
    if STOP is None:
        return
    signal.signal(STOP, patient(ask))
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {STOP})  # held back until now


def patient(react: Callable[[], None]) -> Callable[[int, FrameType | None], None]:
    """Return the handler of a signal that may raise something, as soon as that can be done."""

    def handle(number: int, frame: FrameType | None) -> None:
        if not _in_numba(frame):
            react()
            return
        again = threading.Timer(AGAIN, signal.raise_signal, [number])
        again.daemon = True
        again.start()

    return handle


def _in_numba(frame: FrameType | None) -> bool:
    """Whether compiled code has called Python, for a type; it takes no exception from there.

    Numba (0.68) goes on with what it did not get, which ends the process with a segmentation fault.
    """
    while frame is not None and frame.f_code.co_name != "_numba_unpickle":
        frame = frame.f_back
    return frame is not None
