"""Files that are written whole or not at all."""

from __future__ import annotations

import errno
import os
import platform
import re
import shutil
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from uuid import uuid4

_HERE = sha256(platform.node().encode()).hexdigest()[:8]
ASIDE = f"-{_HERE}.flexaxis"
"""
What the folders end with in which files are written. Where machines share a drive, a lock of
another one may not be seen: each clears its own.
"""
_OURS = re.compile(rf"\..{{0,40}}\.[0-9a-f]{{32}}{re.escape(ASIDE)}", re.DOTALL)


@contextmanager
def atomic(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a path to write to, which at the end takes the place of `path`.

    It has the same name and lies in a hidden folder beside it, which no other process uses.
    Whatever fails, the error passes, the new file is removed and the old one stays. What a process
    that was killed has left is removed by the next one that writes to the same folder.

    Parameters
    ----------
    path : path-like
        File to make or to replace; its folder must exist.

    Yields
    ------
    Path
        Where to write.

    Raises
    ------
    OSError
        If it cannot be written; a device or a pipe cannot be replaced.

    Examples
    --------
    >>> import tempfile
    >>> target = Path(tempfile.mkdtemp()) / "table.csv"
    >>> with atomic(target) as new:
    ...     _ = new.write_text("a,b")
    >>> [file.name for file in target.parent.iterdir()]
    ['table.csv']
    """
    path = Path(path)
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise OSError(errno.EINVAL, "it is a device or a pipe, and no file")
    _clear(path.parent, os.getpid())
    folder, owned = _aside(path)
    try:
        yield folder / path.name
        os.replace(folder / path.name, path)
    finally:
        shutil.rmtree(folder, ignore_errors=True)  # an error would hide why the writing failed
        owned.close()


def _aside(path: Path) -> tuple[Path, ExitStack]:
    """Make a hidden folder beside a file; return it, and the lock by which it is seen to live."""
    while True:
        # part of the name only, for a long one would become too long
        folder = path.with_name(f".{path.stem[:40]}.{uuid4().hex}{ASIDE}")
        folder.mkdir()
        with ExitStack() as stack:
            with suppress(OSError):  # as on drives that know no locks: nobody clears there
                stack.enter_context(_locked(folder, wait=True))
            if folder.exists():  # no one has taken it for one of the dead before it was locked
                return folder, stack.pop_all()


@cache
def _clear(folder: Path, process: int) -> None:
    """Remove what the dead have left in a folder; once a process, for there may be much in it."""
    with suppress(OSError):
        for path in folder.iterdir():
            if _OURS.fullmatch(path.name):
                with suppress(OSError), _locked(path, wait=False):
                    shutil.rmtree(path, ignore_errors=True)


if sys.platform == "win32":

    @contextmanager
    def _locked(folder: Path, *, wait: bool) -> Iterator[None]:
        """There, a folder cannot be locked: what a kill leaves stays."""
        raise OSError(errno.ENOTSUP, "folders cannot be locked")
        yield

else:
    import fcntl

    @contextmanager
    def _locked(folder: Path, *, wait: bool) -> Iterator[None]:
        """Hold the lock of a folder, which the system takes away when its owner ends."""
        file = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
            yield
        finally:
            os.close(file)
