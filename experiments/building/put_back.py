"""After code of a user the folder, NumPy's handling of errors and the depth of calls are put back.

Where an estimator changes the folder, results with a relative path would go elsewhere; what it asks
of NumPy or of the stack would hold for our own sums as well. What else it changes stays so. It
cannot end the process unheard.
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


_inside: list[tuple[int, int]] = []  # thread and process of each `_no_sudden_end` that is open
_usual = [os._exit]  # as it was before the first of them
_one_at_a_time = threading.Lock()


@contextmanager
def _no_sudden_end() -> Iterator[None]:
    """Make `os._exit` an error in this thread and process; others may have their reasons for it.

    Where threads overlap, the last one to leave puts it back.
    """
    here = threading.get_ident(), os.getpid()
    with _one_at_a_time:
        if not _inside:
            _usual[0] = os._exit
        _inside.append(here)
        os._exit = _refused
    try:
        yield
    finally:
        with _one_at_a_time:
            _inside.remove(here)  # not always by the thread that came in: generators move
            if not _inside:
                os._exit = _usual[0]


def _refused(status: int) -> NoReturn:
    if (threading.get_ident(), os.getpid()) in _inside:
        raise SystemExit(f"os._exit({status})")
    _usual[0](status)
