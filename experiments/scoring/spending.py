"""Where the processor's time goes: seconds by name, each without what is counted inside it."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from time import thread_time

OTHER = "else"  # what is in no account

_SHARED = "shared"


class _Here(threading.local):
    """The ledger of this thread, and how long what is inside of each open account took [s]."""

    seconds: dict[str, float] | None = None
    inside: list[float]


_here = _Here()


@contextmanager
def ledger() -> Iterator[Mapping[str, float]]:
    """Give seconds of this thread's processor time by account, filled when the block is left.

    A ledger inside another is by itself: the outer one has none of its time.
    """
    before = _here.seconds, getattr(_here, "inside", None)
    _here.seconds, _here.inside = {}, [0.0]
    mine, start = _here.seconds, thread_time()
    try:
        yield mine
    finally:
        whole = thread_time() - start
        mine[OTHER] = mine.get(OTHER, 0.0) + whole - _here.inside[0]
        _here.seconds = before[0]
        if before[1] is not None:
            _here.inside = before[1]
            _here.inside[-1] += whole


@contextmanager
def spent(account: str) -> Iterator[None]:
    """Put what is done inside on an account; without a ledger, nowhere."""
    seconds = _here.seconds
    if seconds is None:
        yield
        return
    _here.inside.append(0.0)
    start = thread_time()
    try:
        yield
    finally:
        whole = thread_time() - start
        seconds[account] = seconds.get(account, 0.0) + whole - _here.inside.pop()
        _here.inside[-1] += whole


@contextmanager
def shared(accounts: Sequence[str]) -> Iterator[None]:
    """Put what is done inside on several accounts, on each as often as it is named."""
    seconds = _here.seconds
    if seconds is None:
        yield
        return
    try:
        with spent(_SHARED):
            yield
    finally:
        whole = seconds.pop(_SHARED, 0.0)
        for account in accounts:
            seconds[account] = seconds.get(account, 0.0) + whole / len(accounts)
