"""No Python that is started looks for modules in the current folder, which may be one of data.

``python -c`` and ``python -m`` look there first: a file named socket.py that lies beside somebody
else's log would be run, with all rights of the user.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

SAFE_PATH = "PYTHONSAFEPATH"
"""The variable by which a Python leaves the current folder out of where it looks for modules."""
STYLE = "MATPLOTLIBRC"
_OURS = "flexaxis"  # any text does; what the user has set stays
_before: list[str | None] = []  # what each `safe_path` that is open has found, the first one first
_one_at_a_time = threading.Lock()


@contextmanager
def safe_path() -> Iterator[None]:
    """Let a Python that is started meanwhile find no modules in the current folder.

    For those that a library starts, such as the workers of `multiprocessing`; where the words are
    ours, ``-P`` says the same. A worker is to call `forget_safe_path`, for a user's program, which
    inherits its variables, finds its own modules in another way. Where threads overlap, the last
    one to leave puts back what the first one found.
    """
    with _one_at_a_time:
        _before.append(os.environ.get(SAFE_PATH))
        os.environ[SAFE_PATH] = _before[0] or _OURS
    try:
        yield
    finally:
        with _one_at_a_time:
            found = _before.pop()
            if not _before:
                _set(found)


def _set(value: str | None) -> None:
    if value is None:
        os.environ.pop(SAFE_PATH, None)
    else:
        os.environ[SAFE_PATH] = value


def without_its_style() -> None:
    """Have matplotlib imported without the ``matplotlibrc`` of the current folder, if there is one.

    It comes before that of the user, and can have texts set by a LaTeX that reads and writes files.
    """
    if not os.path.exists("matplotlibrc"):
        return
    if chosen := os.environ.get(STYLE):  # by the user, perhaps seen from here
        os.environ[STYLE] = os.path.abspath(chosen)
    here = os.open(".", os.O_RDONLY) if hasattr(os, "fchdir") else os.getcwd()
    os.chdir(os.path.dirname(os.path.abspath(__file__)))
    try:
        import matplotlib  # noqa: F401
    finally:
        os.chdir(here)
        if isinstance(here, int):
            os.close(here)


def forget_safe_path() -> None:
    """Take away, in a worker, what `safe_path` has set for its start."""
    if os.environ.get(SAFE_PATH) == _OURS:
        del os.environ[SAFE_PATH]
