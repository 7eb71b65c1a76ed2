"""
Compilation of functions by numba at their first call; all axis models share the compiled code.

The decorators `compiled` and `loop` mark functions that Python calls and that numba caches. All
other decorators in `compiler` mark functions that numba compiles into their callers. The module
imports numba only when a function is compiled, because this import takes longer than all other work
that is needed to list the estimators.

Numba recompiles a cached function if its own source file changes, but not if the source file of a
function that it calls changes. The name of the cache folder is therefore a digest of all source
files and of the numba version, so any edit leads to a new cache folder.
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
"""The folder that contains the source files of all compiled functions."""


class Compiled:
    """
    A function that numba compiles at the first call.

    Parameters
    ----------
    function : callable
        Python function that numba should compile.
    kept : bool
        Whether Python calls the function and numba caches the compiled code. If ``kept`` is False,
        numba compiles the function into its callers. A call from Python, as in a test, then runs
        the uncompiled function.
    **options : Any
        Options of `numba.njit`. If ``_nrt`` is False (default), the compiled code does not count
        references, so the function can create views but no arrays.
    """

    def __init__(self, function: Callable, *, kept: bool = False, **options: Any) -> None:
        update_wrapper(self, function)
        self.name = function.__name__
        self.function, self.kept, self._options = function, kept, options

    def __call__(self, *arguments: Any) -> Any:
        """Compile the function for new argument types if necessary, and call the function."""
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
"""Decorator for functions that Python calls and that numba compiles."""
loop = partial(Compiled, kept=True)
"""Decorator like `compiled`, for functions that create no arrays."""
inlined = Compiled
"""Decorator for functions that numba compiles into the calling functions."""
fused = partial(Compiled, fastmath={"contract"})
"""Decorator like `inlined` that also allows the compiler to round a·b + c only once."""
embedded = partial(Compiled, forceinline=True)
"""Decorator like `inlined` that forces inlining, for functions that create many views."""
summed = partial(Compiled, fastmath={"contract", "reassoc"})
"""Decorator like `fused` that also allows the compiler to change the order of summands."""


@contextmanager
def _alone(name: str) -> Iterator[None]:
    """Make other processes that need the same function wait until its compiled code is cached."""
    folder, collects = cache_folder(), gc.isenabled()
    if folder is None:
        _tell(
            "compiling filters in every process, because no cache folder is writable; "
            "to compile only once, set FLEXAXIS_COMPILED to a writable folder"
        )
    else:
        with suppress(FileExistsError):  # another process has begun and printed the message
            (folder / "begun").open("x").close()
            _tell(f"compiling filters once on this machine (a minute or two), into {folder}")
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
    """Import numba, set the numba cache folder, and register the type `Compiled`."""
    import numba
    from numba.core.caching import _CacheLocator
    from numba.extending import typeof_impl

    config: Any = numba.config
    config.SLP_VECTORIZE = 1  # combine adjacent scalar operations into vector instructions
    if folder := cache_folder():
        config.CACHE_DIR = str(folder)
        usual = _CacheLocator.get_suitable_cache_subpath

        def place(path: str) -> str:
            """Return a subfolder name that does not depend on where the package is installed."""
            ours = SOURCES in Path(path).parents
            return Path(path).parent.name if ours else usual(path)

        _CacheLocator.get_suitable_cache_subpath = staticmethod(place)  # type: ignore[method-assign]
    typeof_impl.register(Compiled)(lambda value, _: numba.types.Dispatcher(value.dispatcher))
    register()
    return numba


@lru_cache
def cache_folder() -> Path | None:
    """
    Create and return the cache folder for compiled code, or return None if it is not writable.

    The environment variable ``FLEXAXIS_COMPILED``, or else ``NUMBA_CACHE_DIR``, sets the parent
    folder of the cache folder. If neither environment variable is set, the parent folder is a
    subfolder of the user's cache folder.
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
    """Return whether the compiled code of the current source files is missing from the cache."""
    folder = cache_folder()
    return folder is not None and not (folder / "begun").exists()


@lru_cache
def _tell(message: str) -> None:
    print(f"flexaxis: {message} …", file=sys.stderr, flush=True)


def digest(folder: Path) -> str:
    """Return a digest of all source files in a folder and of the numba version."""
    from importlib.metadata import version

    content = sha256(version("numba").encode())
    for path in sorted(folder.rglob("*.py")):
        content.update(path.relative_to(folder).as_posix().encode())
        content.update(path.read_bytes())
    return content.hexdigest()[:16]


def user_cache() -> Path:
    """Return the current user's folder for cached files."""
    if folder := os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA"):
        return Path(folder)
    return Path("~/Library/Caches" if sys.platform == "darwin" else "~/.cache").expanduser()
