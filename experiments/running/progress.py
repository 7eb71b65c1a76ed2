"""What is said on stderr besides results and errors: progress and remarks, or neither.

Progress is a bar in a terminal, lines elsewhere, in a notebook one line in its cell.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TextIO

_QUIET: ContextVar[bool] = ContextVar("quiet", default=False)


@contextmanager
def progress(what: str, total: float) -> Iterator[Callable[[float], None]]:
    """Give a function that is called with the amount done since its last call."""
    from rich.console import Console

    if is_quiet():
        yield lambda amount: None
        return
    if (handle := _notebook()) is not None:
        with _cell(handle, what, total) as advance:
            yield advance
        return
    console = Console(stderr=True)
    shown = _bar if console.is_terminal else _lines
    with shown(console, what, total) as advance:
        yield advance


@contextmanager
def _bar(console, what: str, total: float) -> Iterator[Callable[[float], None]]:  # type: ignore[no-untyped-def]
    from rich.progress import Progress, TimeElapsedColumn

    with Progress(*Progress.get_default_columns(), TimeElapsedColumn(), console=console) as bar:
        task = bar.add_task(what, total=total)
        yield lambda amount: bar.advance(task, amount)


@contextmanager
def _lines(console, what: str, total: float) -> Iterator[Callable[[float], None]]:  # type: ignore[no-untyped-def]
    done, said = 0.0, -1

    def advance(amount: float) -> None:
        nonlocal done, said
        done = min(done + amount, total)  # more may come than was foreseen
        tenth = int(10 * done / total)
        if tenth > said:
            said = tenth
            console.print(f"{what}: {100 * done / total:.0f} %", highlight=False)

    yield advance


PATIENCE = 2.0  # s that a cell of a notebook is silent
EVERY = 0.5  # s between changes of its line


def _notebook() -> Any:
    """Return what shows something in a cell of a notebook, None where this is none."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    if shell is None or not hasattr(shell, "kernel"):
        return None
    from IPython.display import DisplayHandle

    return DisplayHandle()


@contextmanager
def _cell(handle: Any, what: str, total: float) -> Iterator[Callable[[float], None]]:
    """Show one line below the cell once it takes long, and wipe it off at the end."""
    begun = last = time.monotonic()
    done, shown = 0.0, False

    def show(text: str) -> None:
        nonlocal shown
        raw = {"text/plain": text}
        (handle.update if shown else handle.display)(raw, raw=True)
        shown = True

    def advance(amount: float) -> None:
        nonlocal done, last
        done, now = min(done + amount, total), time.monotonic()
        if now - begun < PATIENCE or now - last < EVERY:
            return
        last, left = now, (now - begun) * (total / done - 1) if done else 0.0
        show(f"{what}: {100 * done / total:.0f} %, {left:.0f} s left")

    try:
        yield advance
    finally:
        if shown:
            show("")


@contextmanager
def told(*, quiet: bool, verbose: bool) -> Iterator[None]:
    """Set it for what is done inside; verbose says also with what, and how long it took."""
    token, start = _QUIET.set(quiet), time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show
            if quiet:
                warnings.simplefilter("ignore", UserWarning)
            yield
        if verbose:
            _about(time.perf_counter() - start)
    finally:
        _QUIET.reset(token)


def _show(  # noqa: PLR0917
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Show a warning to users in words alone, and any other with the line that gave it."""
    del file
    told = warnings.formatwarning(message, category, filename, lineno, line)
    sys.stderr.write(f"flexaxis: {message}\n" if category is UserWarning else told)


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
