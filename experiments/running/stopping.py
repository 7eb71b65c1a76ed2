"""Whether the work of this process is to end: asked between cases, by who does them."""

from __future__ import annotations

import threading
from typing import Any

_flags: list[Any] = [threading.Event()]


def begin(flag: Any = None) -> None:
    """Let work go on until it is asked to end, by `ask` or by an event of another process."""
    _flags[0] = threading.Event() if flag is None else flag


def ask() -> None:
    """Let work end after the case that is under way."""
    _flags[0].set()


def asked() -> bool:
    """Whether that was asked for."""
    return bool(_flags[0].is_set())
