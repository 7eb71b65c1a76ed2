"""What a process of `Workers` does at its start and at its end."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable
from multiprocessing.connection import wait as wait_for
from multiprocessing.util import Finalize
from typing import Any

from flexaxis.experiments.building import interrupts

SAFE_PATH = "PYTHONSAFEPATH"
_PR_SET_PDEATHSIG = 1  # of Linux: which signal a process gets when its parent ends


def start(
    stop: Any, begin: Callable[[], object] | None, end_own: Callable[[], object], tied: bool
) -> None:
    """Leave Ctrl-C to the parent, and end when it ends: a killed parent leaves no process.

    Parameters
    ----------
    stop : multiprocessing.Event
        Set where the parent asks it to end what it is doing.
    begin : callable, optional
        Called before any task is done.
    end_own : callable
        Ends what this process has started, before it is waited for.
    tied : bool
        Whether the thread that starts it lives as long as the parent.
    """
    if tied and sys.platform == "linux":  # even in code that lets no other thread run
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    os.environ.pop(SAFE_PATH, None)  # programs of a user find their modules as always
    for kind in (signal.SIGINT, signal.SIGTERM):  # a queue of jobs sends that to all
        signal.signal(kind, signal.SIG_IGN)
    if hasattr(os, "setpgid"):
        os.setpgid(0, 0)  # so that what it starts can be killed with it
    interrupts.begin(stop)
    parent = multiprocessing.parent_process()
    assert parent is not None
    threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()
    Finalize(None, end_own, exitpriority=0)
    Finalize(None, _wait_for_no_thread, exitpriority=-1)  # after what others do at their end
    if begin:
        begin()


def _wait_for_no_thread() -> None:
    """End a process that is done, though a thread of a user's code goes on."""
    others = {*threading.enumerate()} - {threading.main_thread(), threading.current_thread()}
    if not all(thread.daemon for thread in others):
        os._exit(0)


def _end_with(sentinel: int) -> None:
    wait_for([sentinel])
    if hasattr(os, "killpg"):
        os.killpg(0, signal.SIGKILL)  # with what its code has started
    os._exit(1)
