"""No Python that is started looks for modules in the current folder, which may be one of data.

``python -c`` and ``python -m`` look there first: a file named socket.py that lies beside somebody
else's log would be run, with all rights of the user.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

SAFE_PATH = "PYTHONSAFEPATH"
"""The variable by which a Python leaves the current folder out of where it looks for modules."""
_OURS = "flexaxis"  # any text does; what the user has set stays


@contextmanager
def safe_path() -> Iterator[None]:
    """Let a Python that is started meanwhile find no modules in the current folder.

    For those that a library starts, such as the workers of `multiprocessing`; where the words are
    ours, ``-P`` says the same. A worker is to call `forget_safe_path`, for a user's program, which
    inherits its variables, finds its own modules in another way.
    """
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = before or _OURS
    try:
        yield
    finally:
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before


def forget_safe_path() -> None:
    """Take away, in a worker, what `safe_path` has set for its start."""
    if os.environ.get(SAFE_PATH) == _OURS:
        del os.environ[SAFE_PATH]
