"""How much is said on stderr besides results and errors: progress, remarks, or neither."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_QUIET: ContextVar[bool] = ContextVar("quiet", default=False)


@contextmanager
def told(*, quiet: bool, verbose: bool) -> Iterator[None]:
    """Set it for what is done inside; verbose says also with what, and how long it took."""
    token, start = _QUIET.set(quiet), time.perf_counter()
    try:
        yield
        if verbose:
            _about(time.perf_counter() - start)
    finally:
        _QUIET.reset(token)


def is_quiet() -> bool:
    """Whether neither progress nor remarks are wanted."""
    return _QUIET.get()


def remark(text: str) -> None:
    """Say something on stderr that is neither a result nor an error, unless none is wanted."""
    if not is_quiet():
        print(text, file=sys.stderr)


def _about(seconds: float) -> None:
    import platform
    from importlib.metadata import version

    from flexaxis.experiments.running.cache import default_cache

    packages = ("flexaxis", "mujoco", "numpy", "scipy", "numba")
    parts = [f"{name} {version(name)}" for name in packages]
    print(f"with {', '.join(parts)}, Python {platform.python_version()}", file=sys.stderr)
    print(f"records are kept in {default_cache().folder}", file=sys.stderr)
    print(f"took {seconds:.2f} s", file=sys.stderr)
