"""What a process that is started inherits: Ctrl-C, which a terminal sends to all, is for us alone.

Else a program or a worker would end in the middle of its work, and that would look like a fault.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

STOP: signal.Signals | None = getattr(signal, "SIGUSR1", None)
"""What tells a worker to stop; Windows has no such signal."""


@contextmanager
def held_back() -> Iterator[None]:
    """Hold Ctrl-C back while a process may be started, which inherits that.

    So is what tells a worker to stop, until it knows what to do then.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    kinds = {signal.SIGINT, *([STOP] if STOP else [])}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, kinds)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
