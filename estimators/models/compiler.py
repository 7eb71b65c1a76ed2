"""
Compilation of functions by numba on their first call, once for all models.

`compiled` and `loop` mark functions that Python calls and that numba caches; the other decorators
mark functions that are compiled into their callers. Numba is imported only when a function is
compiled, because this import takes longer than everything else that is needed to list the
estimators.

Numba recompiles a cached function when the file of the function changes, but not when the function
calls another file that changes. Therefore the name of the cache folder is a digest of all sources
of the package and of numba's version, so any edit leads to another folder.
"""

import gc
import os
import sqlite3
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from functools import cached_property, lru_cache, partial, update_wrapper
from hashlib import sha256
from pathlib import Path
from typing import Any

from flexaxis.estimators.models.memory import register

SOURCES = Path(__file__).parent.parent
"""The folder that contains the sources of all compiled code."""


class Compiled:
    """
    A function that numba compiles when it is first called.

    Parameters
    ----------
    function : callable
        Function to compile.
    kept : bool
        Whether Python calls the function and numba caches it. Otherwise the function is compiled
        into its callers, and a call from Python, as in a test, runs it uncompiled.
    **options
        Options of `numba.njit`. Unless ``_nrt`` is True, the function may create views but no
        arrays, because references are not counted.
    """

    def __init__(self, function: Callable, *, kept: bool = False, **options: Any) -> None:
        update_wrapper(self, function)
        self.name = function.__name__
        self.function, self.kept, self._options = function, kept, options

    def __call__(self, *arguments: Any) -> Any:
        """Call the function, and compile it first if the types of the arguments are new."""
        return (self.dispatcher if self.kept else self.function)(*arguments)

    def __reduce__(self) -> str:
        return self.name

    @cached_property
    def dispatcher(self) -> Any:
        """The compiled function, or the original function if NUMBA_DISABLE_JIT=1."""
        numba = _numba()
        options: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        if self.kept:
            options = {"nogil": True, "cache": cache_folder() is not None}
        options |= {"error_model": "numpy", "_nrt": False} | self._options
        dispatcher = numba.njit(**options)(self.function)
        if self.kept and dispatcher is not self.function:
            build = dispatcher._compile_for_args  # numba calls it for each new signature

            def build_alone(*arguments: Any) -> Any:
                with _alone(self.name):
                    return build(*arguments)

            dispatcher._compile_for_args = build_alone
        return dispatcher


compiled = partial(Compiled, kept=True, _nrt=True)
"""Compile a function that Python calls."""
loop = partial(Compiled, kept=True)
"""Compile a function that Python calls and that creates no arrays."""
inlined = Compiled
"""Compile a function into its callers."""
fused = partial(Compiled, fastmath={"contract"})
"""Compile a function as `inlined` does, but allow a·b + c to be rounded once."""
embedded = partial(Compiled, forceinline=True)
"""Compile a function as `inlined` does, but force inlining (for functions with many views)."""
summed = partial(Compiled, fastmath={"contract", "reassoc"})
"""Compile a function as `fused` does, but allow sums to be taken in any order."""


@contextmanager
def _alone(name: str) -> Iterator[None]:
    """Make other processes that need the function wait until it is cached."""
    folder, collects = cache_folder(), gc.isenabled()
    if folder is None:
        _tell("in every process, because no cache folder is writable")
    else:
        with suppress(FileExistsError):  # another process has begun and printed the message
            (folder / "begun").open("x").close()
            _tell(f"once on this machine (a minute or two), into {folder}")
    lock = sqlite3.connect(folder / f"{name}.lock" if folder else ":memory:", timeout=3600)
    gc.disable()  # garbage collection takes a sixth of the time and frees almost nothing
    try:
        with closing(lock):  # this lock works on every system, and a process that ends releases it
            lock.execute("BEGIN EXCLUSIVE")
            yield
    finally:
        if collects:
            gc.enable()


@lru_cache
def _numba() -> Any:
    """Import numba, set its cache folder, and register the type `Compiled`."""
    import numba
    from numba.core.caching import _CacheLocator
    from numba.extending import typeof_impl

    config: Any = numba.config
    config.SLP_VECTORIZE = 1  # combine adjacent scalar operations into vector instructions
    if folder := cache_folder():
        config.CACHE_DIR = str(folder)
        usual = _CacheLocator.get_suitable_cache_subpath

        def place(path: str) -> str:
            """Return the same subfolder for every copy of these sources, regardless of location."""
            ours = SOURCES in Path(path).parents
            return Path(path).parent.name if ours else usual(path)

        _CacheLocator.get_suitable_cache_subpath = staticmethod(place)  # type: ignore[method-assign]
    typeof_impl.register(Compiled)(lambda value, _: numba.types.Dispatcher(value.dispatcher))
    register()
    return numba


@lru_cache
def cache_folder() -> Path | None:
    """
    Create and return the folder for compiled code, or return None if it is not writable.

    The folder lies below ``FLEXAXIS_COMPILED`` or ``NUMBA_CACHE_DIR`` if one of these variables is
    set, otherwise below the user's cache folder.
    """
    given = os.environ.get("FLEXAXIS_COMPILED") or os.environ.get("NUMBA_CACHE_DIR")
    try:
        base = Path(given) if given else user_cache() / "flexaxis" / "compiled"
        folder = base / digest(SOURCES)
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except (OSError, RuntimeError):  # RuntimeError: the user has no home folder
        return None
    return folder


def is_uncompiled() -> bool:
    """Return whether compiled code of these sources is missing from the cache."""
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
    """Return the cache folder of this user on this system."""
    if folder := os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA"):
        return Path(folder)
    return Path("~/Library/Caches" if sys.platform == "darwin" else "~/.cache").expanduser()
