"""Compile a loop for the pattern of a model, and keep the result in the user's cache folder."""

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock

import numpy as np
from numba import boolean, config, float64, from_dtype, njit, void

OPTIONS = {"nogil": True, "error_model": "numpy"}

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
        from_dtype(tuning)[::1], from_dtype(state)[::1], signal, signal, boolean[::1], float64[:, ::1]
    )
    # a name of its own gives every pattern files of its own, so that processes which compile
    # different patterns at the same time cannot take each other's
    loop.__qualname__ = f"{loop.__name__}_{_digest(flat)}"
    folder = cache_folder()
    known = folder is not None and any(folder.rglob(f"*.{loop.__qualname__}-*.nbc"))
    if not known:
        where = f"for {folder}" if folder else "for this process, as no cache folder can be written"
        print(f"flexaxis: compiling the estimator once {where} …", file=sys.stderr, flush=True)
    if folder is not None:
        # a broken or full cache must stop nobody; an error of the loop comes again below
        with suppress(Exception), _numba_cache(folder):
            return njit(signature, cache=True, **OPTIONS)(loop)
    return njit(signature, **OPTIONS)(loop)


def cache_folder() -> Path | None:
    """
    Return the folder for compiled loops, made if need be; None if nothing can be written there.

    ``NUMBA_CACHE_DIR`` if that is set, else ``flexaxis`` in the user's cache folder.
    """
    folder = Path(config.CACHE_DIR) if config.CACHE_DIR else _user_cache() / "flexaxis" / "compiled"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return None
    return folder


def _user_cache() -> Path:
    if folder := os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA"):
        return Path(folder)
    return Path("~/Library/Caches" if sys.platform == "darwin" else "~/.cache").expanduser()


@contextmanager
def _numba_cache(folder: Path) -> Iterator[None]:
    """Let numba cache into the folder; it reads this setting when a function is declared."""
    with _lock:
        before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
        try:
            yield
        finally:
            config.CACHE_DIR = before


def _digest(flat: tuple[int, ...]) -> str:
    # numba notices a change of the loop's own file; these are the others that it is made of
    sources = [Path(__file__).with_name(f"{name}.py") for name in ("lanes", "emit", "pattern")]
    content = b"".join(source.read_bytes() for source in sources) + repr(flat).encode()
    return hashlib.sha256(content).hexdigest()[:12]
