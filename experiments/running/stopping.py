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
LOST = 1.0  # s after which it is, if what was raised has ended nothing


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
    meant : callable
        Whether a stop that comes is meant for what goes on now.
    """

    def __init__(self) -> None:
        self.asked = self.able = False
        self.meant: Callable[[], bool] = lambda: False


_state = _State()


def ask() -> None:
    """Stop the work of this process; to be called in its main thread, by the handler of a signal.

    Raises
    ------
    Stopped
        If work is under way; else it will end as soon as it begins.
    """
    if not _state.meant():  # it came late: what it was for has ended, and something else goes on
        return
    _state.asked = True
    if _state.able:
        raise Stopped


def under_way() -> bool:
    """Whether there is work in this process that may be left where it is."""
    return _state.able


def begin(meant: Callable[[], bool] = lambda: True) -> Callable[[], bool]:
    """Let work begin again, which a stop ends only while `meant()`; return what held before."""
    before, _state.meant = _state.meant, meant
    _state.asked = False
    return before


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
        _state.able = self._before and not stopped
        return stopped


def heed() -> bool:
    """Let `STOP` stop the work of this process; return whether it does.

    It stays so, for a signal may be on its way, and without work does nothing.
    """
    if STOP is None or signal.getsignal(STOP) not in {signal.SIG_DFL, _HEEDED}:
        return False  # it is somebody else's
    signal.signal(STOP, _HEEDED)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {STOP})  # held back until now
    return True


def patient(
    react: Callable[[], None], wanted: Callable[[], bool]
) -> Callable[[int, FrameType | None], None]:
    """Return the handler of a signal that may raise something, as soon as that can be done.

    It does so again where that is still wanted a moment later: what is raised while an object goes,
    Python drops.

    Parameters
    ----------
    react : callable
    wanted : callable
        Whether what is to be ended goes on.
    """

    def handle(number: int, frame: FrameType | None) -> None:
        if _in_numba(frame):
            _send(number, AGAIN, lambda: True)
            return
        try:
            react()
        except BaseException:
            _send(number, LOST, wanted)
            raise

    return handle


_HEEDED = patient(ask, under_way)


def _send(number: int, seconds: float, wanted: Callable[[], bool]) -> None:
    """Send this process a signal a moment later, if that is still wanted then."""

    def send() -> None:
        if not wanted():
            return
        if hasattr(signal, "pthread_kill"):  # which also ends a wait of the main thread
            signal.pthread_kill(threading.main_thread().ident or 0, number)
        else:
            signal.raise_signal(number)

    later = threading.Timer(seconds, send)
    later.daemon = True
    later.start()


def _in_numba(frame: FrameType | None) -> bool:
    """Whether compiled code has called Python, for a type; it takes no exception from there.

    Numba (0.68) goes on with what it did not get, which ends the process with a segmentation fault.
    """
    while frame is not None and frame.f_code.co_name != "_numba_unpickle":
        frame = frame.f_back
    return frame is not None
