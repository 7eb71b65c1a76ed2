"""What code of a user changes in this process is put back, and it cannot end the process unheard.

Where an estimator changes the folder, results with a relative path would go elsewhere; what it asks
of NumPy or of the stack would hold for our own sums as well.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import NoReturn

import numpy as np


@contextmanager
def put_back() -> Iterator[None]:
    """Put back the folder, NumPy's handling of errors and the depth of calls at the end.

    Raises
    ------
    SystemExit
        Inside, in the place of `os._exit`, which would end a command with a status of its choice
        and without a word.
    """
    folder, depth = _folder(), sys.getrecursionlimit()
    try:
        with np.errstate(), _no_sudden_end():
            yield
    finally:
        if sys.getrecursionlimit() != depth:
            with suppress(RecursionError):  # we are deeper than that: it was lowered inside as well
                sys.setrecursionlimit(depth)
        if folder is not None and _folder() != folder:
            with suppress(OSError):
                os.chdir(folder)


def _folder() -> str | None:
    try:
        return os.getcwd()
    except OSError:  # it was removed
        return None


@contextmanager
def _no_sudden_end() -> Iterator[None]:
    """Make `os._exit` an error in this thread and process; others may have their reasons for it."""
    usual, thread, process = os._exit, threading.get_ident(), os.getpid()

    def refused(status: int) -> NoReturn:
        if (threading.get_ident(), os.getpid()) != (thread, process):
            usual(status)
        raise SystemExit(f"os._exit({status})")

    os._exit = refused
    try:
        yield
    finally:
        os._exit = usual
