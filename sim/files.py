"""Files that are written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import uuid4


@contextmanager
def atomic(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a path to write to, which at the end takes the place of `path`.

    It lies beside it, hidden, under a name that no other process uses and with the same suffix.
    Whatever fails, the error passes, the new file is removed and the old one stays; a process that
    is killed may leave the hidden one.

    Parameters
    ----------
    path : path-like
        File to make or to replace; its folder must exist.

    Yields
    ------
    Path
        Where to write.

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
    # part of the name only, for a long one would become too long
    new = path.with_name(f".{path.stem[:40]}.{uuid4().hex}{path.suffix}")
    try:
        yield new
        os.replace(new, path)
    finally:
        with suppress(OSError):  # or it would hide why the writing failed
            new.unlink(missing_ok=True)
