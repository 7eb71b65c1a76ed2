"""What is compiled on the way is on an account of its own, whoever needs it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from flexaxis.experiments.scoring.spending import spent

COMPILING = "compiling"  # the account of what that takes


@contextmanager
def compiled_apart() -> Iterator[None]:
    """Put what numba compiles inside on that account; to load what is compiled is on no such."""
    from numba.core import event

    class Compiling(event.Listener):  # type: ignore[misc]
        def __init__(self) -> None:
            self._here = threading.local()

        def on_start(self, event: Any) -> None:
            entered: AbstractContextManager[None] = spent(COMPILING)
            self._open.append(entered)
            entered.__enter__()

        def on_end(self, event: Any) -> None:
            if self._open:
                self._open.pop().__exit__(None, None, None)

        @property
        def _open(self) -> list[AbstractContextManager[None]]:
            return self._here.__dict__.setdefault("open", [])

    with event.install_listener("numba:compile", Compiling()):
        yield
