"""
How functions are compiled: by numba, once for all models, when one is first called.

`compiled` marks what Python calls, which numba keeps, and the others what is compiled with it.
Numba is not imported before: it takes longer than all else that a list of estimators needs.

Numba judges what it keeps of a function by the file of that function alone. Here a function calls
those of other files, so the folder is named by a digest of all sources of the package, and of the
version of numba: an edit of any of them makes another folder.
"""

import gc
import os
import sys
import tempfile
from collections.abc import Callable
from functools import cached_property, lru_cache, update_wrapper
from hashlib import sha256
from pathlib import Path
from typing import Any

SOURCES = Path(__file__).parent.parent
"""The folder whose sources decide whether what is kept is still right."""


class Compiled:
    """
    A function that numba compiles when it is first called.

    Parameters
    ----------
    function : callable
    kept : bool
        Whether Python calls it and numba keeps it; else it is compiled with what calls it, and
        Python, as in a test, calls it as it is written.
    **options
        Of `numba.njit`. Without its ``_nrt`` a function makes no arrays, but views of those that it
        is handed, and nothing counts who holds them.
    """

    def __init__(self, function: Callable, *, kept: bool = False, **options: Any) -> None:
        update_wrapper(self, function)
        self.name = function.__name__
        self.function, self.kept, self._options = function, kept, options
        self._called = False

    def __call__(self, *arguments: Any) -> Any:
        """Call it; what is not yet compiled is compiled now."""
        if not self.kept:
            return self.function(*arguments)
        return self.dispatcher(*arguments) if self._called else self._first_call(arguments)

    def __reduce__(self) -> str:
        return self.name

    def _first_call(self, arguments: tuple) -> Any:
        """Call it, and say so where it has to be compiled."""
        call, folder = self.dispatcher, cache_folder()
        kept = folder is not None and any(folder.rglob(f"*.{self.name}-*.nbi"))
        if call is not self.function and not kept:
            where = f"once, into {folder}" if folder else "as no cache folder can be written"
            print(f"flexaxis: compiling {self.name} {where} …", file=sys.stderr, flush=True)
        collecting = gc.isenabled()
        gc.disable()  # looking for garbage takes a sixth of the time, and finds next to none
        try:
            return call(*arguments)
        finally:
            self._called = True
            if collecting:
                gc.enable()

    @cached_property
    def dispatcher(self) -> Any:
        """What numba makes of the function; with NUMBA_DISABLE_JIT=1 the function itself."""
        numba = _numba()
        options: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        if self.kept:
            options = {"nogil": True, "cache": cache_folder() is not None}
        options |= {"error_model": "numpy", "_nrt": False} | self._options
        return numba.njit(**options)(self.function)


def compiled(function: Callable) -> Compiled:
    """Compile a function on its first call, and keep the result."""
    return Compiled(function, kept=True, _nrt=True)


def loop(function: Callable) -> Compiled:
    """Compile a function as `compiled` does, where it makes no arrays of its own."""
    return Compiled(function, kept=True)


def inlined(function: Callable) -> Compiled:
    """Compile a function with those that call it."""
    return Compiled(function)


def fused(function: Callable) -> Compiled:
    """Compile a function as `inlined` does, where a·b + c may be rounded once."""
    return Compiled(function, fastmath={"contract"})


def embedded(function: Callable) -> Compiled:
    """Compile a function into each of its callers, such as one that returns many views."""
    return Compiled(function, forceinline=True)


def summed(function: Callable) -> Compiled:
    """Compile a function as `fused` does, where sums may be taken in any order."""
    return Compiled(function, fastmath={"contract", "reassoc"})


@lru_cache
def _numba() -> Any:
    """Return numba, told where to keep what it compiles, and of what a `Compiled` is to it."""
    import numba
    from numba.extending import typeof_impl

    config: Any = numba.config
    config.SLP_VECTORIZE = 1  # numbers that are written side by side become vectors
    folder = cache_folder()
    if folder is not None:
        config.CACHE_DIR = str(folder)
    typeof_impl.register(Compiled)(lambda value, _: numba.types.Dispatcher(value.dispatcher))
    return numba


@lru_cache
def cache_folder() -> Path | None:
    """
    Return the folder for compiled code, made if need be; None if nothing can be written there.

    Below ``FLEXAXIS_COMPILED`` or ``NUMBA_CACHE_DIR`` if that is set, else the user's cache folder.
    It holds code: one that belongs to another user is not used.
    """
    given = os.environ.get("FLEXAXIS_COMPILED") or os.environ.get("NUMBA_CACHE_DIR")
    try:
        base = Path(given) if given else user_cache() / "flexaxis" / "compiled"
        folder = base / digest(SOURCES)
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        if hasattr(os, "getuid") and folder.stat().st_uid not in {0, os.getuid()}:
            return None
    except (OSError, RuntimeError):  # RuntimeError: a user without a home
        return None
    return folder


def digest(folder: Path) -> str:
    """Return a digest of all sources of a folder and of numba's version."""
    from importlib.metadata import version

    content = sha256(version("numba").encode())
    for path in sorted(folder.rglob("*.py")):
        content.update(path.relative_to(folder).as_posix().encode())
        content.update(path.read_bytes())
    return content.hexdigest()[:16]


def user_cache() -> Path:
    """Return the folder in which this system's user keeps what can be made again."""
    if folder := os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA"):
        return Path(folder)
    return Path("~/Library/Caches" if sys.platform == "darwin" else "~/.cache").expanduser()
