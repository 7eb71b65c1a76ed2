"""A lock on a file that the system takes away when its owner ends, however it ends."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from flexaxis.experiments.running.errors import StudyError
from flexaxis.experiments.running.files import writing


@contextmanager
def locked(path: Path, *, shared: bool = False) -> Iterator[None]:
    """Hold a lock; the file stays, for it is the lock and not the file that counts.

    Parameters
    ----------
    path : Path
        Made if it is missing.
    shared : bool
        Whether others may hold it too, who share it as well. Windows has no such locks: there
        it is none.

    Raises
    ------
    StudyError
        If another process holds it.
    """
    with writing(path):
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        try:
            _lock(file, shared)
        except OSError as error:
            raise StudyError(
                f"{path.parent}: another process is at work here. Wait for it or end it; "
                "to share the work, give each process a --shard I/N"
            ) from error
        yield
    finally:
        with suppress(OSError):
            os.close(file)  # which gives the lock back


if sys.platform == "win32":

    def _lock(file: int, shared: bool) -> None:
        import msvcrt

        if not shared:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)

else:

    def _lock(file: int, shared: bool) -> None:
        import fcntl

        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
