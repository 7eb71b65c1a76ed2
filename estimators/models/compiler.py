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
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from functools import cached_property, lru_cache, update_wrapper
from hashlib import sha256
from pathlib import Path
from typing import Any

try:
    import fcntl
except ImportError:  # Windows: two processes may compile the same, and keep it twice
    fcntl = None  # type: ignore[assignment]

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
        """Call it; what is not yet compiled is compiled now, by one process at a time."""
        call = self.dispatcher if self.kept else self.function
        if self._called or call is self.function:
            return call(*arguments)
        with _alone(self.name):
            self._called = True
            return call(*arguments)

    def __reduce__(self) -> str:
        return self.name

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


@contextmanager
def _alone(name: str) -> Iterator[None]:
    """Let other processes wait that need a function of this name, and then find it compiled."""
    folder, collects = cache_folder(), gc.isenabled()
    if folder is None:
        _tell("in every process, as no cache folder can be written")
    else:
        with suppress(FileExistsError):  # somebody else has begun, and has told
            (folder / "begun").open("x").close()
            _tell(f"once on this machine, a minute or two, into {folder}")
    gc.disable()  # looking for garbage takes a sixth of the time, and finds next to none
    try:
        with (folder / f"{name}.lock").open("w") if folder and fcntl else nullcontext() as file:
            if file:
                fcntl.flock(file, fcntl.LOCK_EX)
            yield
    finally:
        if collects:
            gc.enable()


@lru_cache
def _numba() -> Any:
    """Return numba, told where to keep what it compiles, and of what a `Compiled` is to it."""
    import numba
    from numba.core.caching import _CacheLocator
    from numba.extending import typeof_impl

    config: Any = numba.config
    config.SLP_VECTORIZE = 1  # numbers that are written side by side become vectors
    if folder := cache_folder():
        config.CACHE_DIR = str(folder)
        usual = _CacheLocator.get_suitable_cache_subpath

        def place(path: str) -> str:
            """Return the same folder for every copy of these sources, wherever it is."""
            ours = SOURCES in Path(path).parents
            return Path(path).parent.name if ours else usual(path)

        _CacheLocator.get_suitable_cache_subpath = staticmethod(place)  # type: ignore[method-assign]
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


def is_uncompiled() -> bool:
    """Return whether nothing was ever compiled of these sources, and may be kept."""
    folder = cache_folder()
    return folder is not None and not (folder / "begun").exists()


@lru_cache
def _tell(how: str) -> None:
    print(f"flexaxis: compiling filters {how} …", file=sys.stderr, flush=True)


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
