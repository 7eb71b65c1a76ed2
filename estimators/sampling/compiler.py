"""
The one decorator for all that numba compiles: on first use, kept for good, and never stale.

`compiled` and `inlined` mark functions. Nothing is imported or compiled before one of them is
called. What has been compiled is kept in the user's cache folder under a digest of everything that
it is made from, so that an edit of any function that is reached, or of a constant in it, compiles
anew, and nothing else does.
"""

import hashlib
import marshal
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import cached_property, lru_cache, update_wrapper, wraps
from importlib import import_module
from inspect import getclosurevars, getsourcefile
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

from flexaxis.estimators.sampling.kept import Nowhere, Store
from flexaxis.estimators.sampling.symbols import distinct

PACKAGE = __name__.partition(".")[0]
OVERLOADS = (  # of the functions in `lanes`, `points`, `symmetric` and `dense`
    "flexaxis.estimators.sampling.dense_code",
    "flexaxis.estimators.sampling.overloads",
    "flexaxis.estimators.sampling.symmetric_code",
)


class Compiled:
    """
    A function that numba compiles when it is first called.

    Parameters
    ----------
    function : callable
        What is compiled. What it calls is compiled with it, if it is decorated as well.
    inline : bool
        Whether it becomes a part of each of its callers, and is not kept by itself.
    alone : bool
        Whether it is optimised before its callers take it in, and not only with them.
    label : str, optional
        What the user is told is being compiled.
    """

    def __init__(
        self, function: Callable, *, inline: bool = False, alone: bool = False, label: str = ""
    ) -> None:
        self.function, self.inline, self.alone = function, inline, alone
        self.label = label or f"{function.__module__}.{function.__name__}"
        self.name = function.__name__
        self.origin: tuple[Callable, tuple] | None = None  # what makes it anew in another process
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function; it is compiled now if it has to be."""
        try:
            return self.dispatcher(*arguments)
        except BaseException:
            if cache := getattr(self.dispatcher, "_cache", None):
                getattr(cache, "ended", lambda: None)()  # it may not have compiled
            raise

    def __reduce__(self) -> str | tuple:
        # a function of a module goes by its name, one made for a pattern by what made it
        return self.function.__qualname__ if self.origin is None else self.origin

    @cached_property
    def dispatcher(self) -> Any:
        """What numba calls a compiled function, for Python to call."""
        _introduce()
        made = _numbas().whole(self.function)
        if not self.inline:
            made._cache = self._kept_in()
        return made

    def _kept_in(self) -> Nowhere:
        """Where its machine code is kept."""
        if not distinct():
            return Nowhere(self.label, "each time, as this numba may give two functions one name")
        folder = cache_folder()
        return Store(self, folder) if folder else Nowhere(self.label)

    def kept(self, *arguments: Any) -> bool:
        """Whether it has been compiled for such arguments, here or in the cache folder."""
        from numba import typeof

        made, kinds = self.dispatcher, tuple(typeof(argument) for argument in arguments)
        store = made._cache
        return kinds in made.overloads or (
            isinstance(store, Store) and store.path(kinds, made.targetctx.codegen()).exists()
        )

    @cached_property
    def part(self) -> Any:
        """The same, for compiled code to call."""
        return _numbas().part(self.function, inline=self.inline, alone=self.alone)

    @cached_property
    def digest(self) -> str:
        """What tells this function, and all that it reaches, from any other."""
        numbas = _numbas()
        parts = hashlib.sha256(_source(numbas))
        parts.update(repr((numbas.OPTIONS, numbas.PART_OPTIONS)).encode())
        for part in _content(self, set()):
            parts.update(part)
        return parts.hexdigest()


def compiled(function: Callable) -> Compiled:
    """Compile a function on its first call, and keep the result."""
    return Compiled(function)


def optimized(function: Callable) -> Compiled:
    """
    Compile a function as `compiled` does, optimised by itself first: for what is long and hot.

    As a part of its callers, before anything is optimised, it would take them half as long again.
    """
    return Compiled(function, alone=True)


def inlined(function: Callable) -> Compiled:
    """Compile a function as a part of those that call it."""
    return Compiled(function, inline=True)


def remembered(factory: Callable[..., Compiled]) -> Callable[..., Compiled]:
    """
    Make a compiled function once for the same arguments, and anew where it is unpickled.

    Parameters
    ----------
    factory : callable
        Of a module, with arguments that can be hashed and pickled.
    """

    @lru_cache
    @wraps(factory)
    def make(*arguments: Any) -> Compiled:
        made = factory(*arguments)
        made.origin = make, arguments
        return made

    return make


@lru_cache
def _numbas() -> ModuleType:
    """Return the module that imports numba, which takes half a second; before any code is named."""
    distinct()
    try:
        return import_module("flexaxis.estimators.sampling.parts")
    except (ImportError, AttributeError):  # another numba, without what is its own there
        return import_module("flexaxis.estimators.sampling.plain")


@lru_cache
def _introduce() -> None:
    """Tell numba what a `Compiled` is that it meets in another function, and of `OVERLOADS`."""
    from numba import types
    from numba.extending import typeof_impl

    for module in OVERLOADS:
        import_module(module)

    @typeof_impl.register(Compiled)
    def _typeof(value: Compiled, context: object) -> object:
        return types.Dispatcher(value.part)


def _content(value: object, seen: set[int]) -> Iterator[bytes]:
    """Yield all that the code compiled for a value is made from, each function once."""
    value = getattr(value, "_defn", value)  # what an intrinsic of numba is made of
    if isinstance(value, Compiled):
        value = value.function
    elif isinstance(value, type | FunctionType):  # runs in the compiler, so that its file matters
        yield from _files(value.__module__, seen)
        for module in OVERLOADS:
            yield from _files(module, seen)
        return
    if isinstance(value, FunctionType):
        if id(value) in seen:
            return
        seen.add(id(value))
        yield from _code(value.__code__)
        names = getclosurevars(value)
        for name, used in sorted((dict(names.globals) | dict(names.nonlocals)).items()):
            yield name.encode()
            yield from _content(used, seen)
    elif isinstance(value, int | float | complex | str | bytes | tuple | frozenset | None):
        yield repr(value).encode()
    elif hasattr(value, "tobytes"):  # an array is a constant too
        yield value.tobytes()


def _code(code: CodeType) -> Iterator[bytes]:
    yield code.co_code + repr((code.co_names, code.co_varnames)).encode()
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _code(constant)
        else:
            yield repr(constant).encode()


def _files(module: str, seen: set[int]) -> Iterator[bytes]:
    """Yield the source of a module of ours, and of those from which it takes anything."""
    if not module.startswith(f"{PACKAGE}."):
        return
    found = import_module(module)
    if id(found) in seen:
        return
    seen.add(id(found))
    yield _source(found)
    origins = {getattr(value, "__module__", None) for value in vars(found).values()}
    for used in sorted(name for name in origins if isinstance(name, str)):
        yield from _files(used, seen)


def _source(module: ModuleType) -> bytes:
    """Return the source of a module, or where it is not installed what it was compiled to."""
    try:
        return Path(getsourcefile(module) or "").read_bytes()
    except OSError:
        code = module.__spec__.loader.get_code(module.__name__)  # type: ignore[union-attr]
        return marshal.dumps(code)


@lru_cache
def cache_folder() -> Path | None:
    """
    Return the folder for compiled code, made if need be; None if nothing can be written there.

    ``NUMBA_CACHE_DIR`` if that is set, else ``flexaxis`` in the user's cache folder.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    try:
        folder = Path(given) if given else user_cache() / "flexaxis" / "compiled"
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except (OSError, RuntimeError):  # RuntimeError: a user without a home
        return None
    return folder


def user_cache() -> Path:
    """Return the folder in which this system's user keeps what can be made again."""
    if folder := os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA"):
        return Path(folder)
    return Path("~/Library/Caches" if sys.platform == "darwin" else "~/.cache").expanduser()
