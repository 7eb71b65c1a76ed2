"""Compile a loop for the pattern of a model, and keep the result in the user's cache folder."""

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock
from typing import Any

import numba
import numpy as np
from llvmlite.binding import get_host_cpu_features, get_host_cpu_name
from numba import boolean, float64, from_dtype, njit, void

jit = njit(nogil=True, error_model="numpy", forceinline=True)
"""Decorator of what compiled loops call."""

_settings: Any = numba.config  # a module that makes its attributes when it is imported
_lock = Lock()


def compile_loop(
    loop: Callable, flat: tuple[int, ...], tuning: np.dtype, state: np.dtype
) -> Callable:
    """
    Compile ``loop(tuning, state, u, y, valid, estimates)``, or load it from the cache.

    Says so on stderr if it has to compile. Several processes may compile the same loop at the
    same time; a folder that cannot be written means compiling in every process.

    Parameters
    ----------
    loop : callable
        A closure over ``flat``.
    flat : tuple of int
        The pattern of the model; makes the loop another one for the cache.
    tuning, state : dtype
        Record types of the first two arguments.

    Returns
    -------
    callable
    """
    signal = float64[::1]
    signature = void(
        from_dtype(tuning)[::1],
        from_dtype(state)[::1],
        signal,
        signal,
        boolean[::1],
        float64[:, ::1],
    )
    # a name of its own gives every pattern files of its own, so that processes which compile
    # different ones at the same time cannot take each other's
    loop.__qualname__ = f"{loop.__name__}_{_digest(loop, flat)}"
    folder = cache_folder()
    known = folder is not None and any(folder.rglob(f"*.{loop.__qualname__}-*.nbc"))
    if not known:
        where = f"once, into {folder}" if folder else "as no cache folder can be written"
        what = f"a filter for {flat[0]} states and {flat[1]} parameters"
        print(f"flexaxis: compiling {what} {where} …", file=sys.stderr, flush=True)
    if folder is not None:
        # a broken or full cache must stop nobody; an error of the loop comes again below
        with suppress(Exception), _numba_cache(folder):
            return njit(signature, cache=True, nogil=True, error_model="numpy")(loop)
    return njit(signature, nogil=True, error_model="numpy")(loop)


def cache_folder() -> Path | None:
    """
    Return the folder for compiled loops, made if need be; None if nothing can be written there.

    ``NUMBA_CACHE_DIR`` if that is set, else ``flexaxis`` in the user's cache folder.
    """
    folder = (
        Path(_settings.CACHE_DIR) if _settings.CACHE_DIR else user_cache() / "flexaxis" / "compiled"
    )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return None
    return folder


def user_cache() -> Path:
    """Return the folder in which this system's user keeps what can be made again."""
    if folder := os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA"):
        return Path(folder)
    return Path("~/Library/Caches" if sys.platform == "darwin" else "~/.cache").expanduser()


@contextmanager
def _numba_cache(folder: Path) -> Iterator[None]:
    """Let numba cache into the folder; it reads this setting when a function is declared."""
    with _lock:
        before, _settings.CACHE_DIR = _settings.CACHE_DIR, str(folder)
        try:
            yield
        finally:
            _settings.CACHE_DIR = before


def _digest(loop: Callable, flat: tuple[int, ...]) -> str:
    # all that the compiled code depends on; a home folder may serve many kinds of machine
    here = Path(__file__).parents[1]
    names = "sampling/lanes", "sampling/emit", "sampling/pattern", "recursion/kernel"
    sources = [here / f"{name}.py" for name in names]
    sources.append(Path(loop.__code__.co_filename))
    called = (value for value in loop.__globals__.values() if hasattr(value, "py_func"))
    sources += sorted({Path(value.py_func.__code__.co_filename) for value in called})
    machine = get_host_cpu_name(), get_host_cpu_features().flatten(), numba.__version__
    content = b"".join(source.read_bytes() for source in sources)
    return hashlib.sha256(content + repr((machine, flat)).encode()).hexdigest()[:12]
