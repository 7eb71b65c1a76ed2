"""
The one decorator for all that numba compiles: on first use, kept for good, and never stale.

`compiled` and `inlined` mark functions. Nothing is imported or compiled before one of them is
called. Then it is written, with all that it reaches, into a module of its own, which numba compiles
and keeps by what it documents, ``njit(cache=True)``. The module is named after its content, in the
user's cache folder: an edit of any function that is reached, or of a constant in it, makes another
module, and nothing else does.
"""

import gc
import os
import pickle
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cached_property, lru_cache, update_wrapper, wraps
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from flexaxis.estimators.models.source import Rendered, digest, rendered, written


class Compiled:
    """
    A function that numba compiles when it is first called.

    Parameters
    ----------
    function : callable or str
        What is compiled, or its source, which needs nothing but its arguments. What it calls is
        compiled with it, if it is decorated as well.
    inline : bool
        Whether it becomes a part of each of its callers, however long it is.
    fused : bool
        Whether a·b + c may be rounded once, where the processor can.
    label : str, optional
        What the user is told is being compiled.
    """

    def __init__(
        self,
        function: Any,
        *,
        inline: bool = False,
        fused: bool = False,
        label: str = "",
    ) -> None:
        self.function, self.inline, self.fused = function, inline, fused
        self._called = False
        self.origin: tuple[Callable, tuple] | None = None  # what makes it anew in another process
        if callable(function):
            update_wrapper(self, function)
            label = label or f"{function.__module__}.{function.__name__}"
        self.label = label

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function; it is compiled now if it has to be."""
        if self._called:
            return self.dispatcher(*arguments)
        with _first_call(self._loaded[1], self.label):
            try:
                result = self.dispatcher(*arguments)
            except (EOFError, pickle.UnpicklingError, ImportError, AttributeError):
                # what is kept of it is torn, or names types of another version of flexaxis
                _remove(self.dispatcher)
                result = self.dispatcher(*arguments)
        self._called = True
        return result

    def __reduce__(self) -> str | tuple:
        # a function of a module goes by its name, one made for a pattern by what made it
        if self.origin is not None:
            return self.origin
        assert callable(self.function)
        return self.function.__qualname__

    def prepare(self, call: Callable[[], object]) -> None:
        """Compile it by a call of it, unless whoever is about it `gathers` what is to be."""
        found = GATHERED.get()
        if found is None or self._called or _is_done(self._loaded[1]):
            call()
        else:
            found.add(self.rendered.name)

    @cached_property
    def rendered(self) -> Rendered:
        """Its source, under a name that no other function has."""
        return rendered(self)

    @cached_property
    def dispatcher(self) -> Any:
        """What numba calls a compiled function, for Python to call."""
        return self._loaded[0]

    @cached_property
    def _loaded(self) -> tuple[Any, Path | None]:
        return _load(self.rendered.name, written(self), cache_folder())


def compiled(function: Callable) -> Compiled:
    """Compile a function on its first call, and keep the result."""
    return Compiled(function)


def inlined(function: Callable) -> Compiled:
    """Compile a function as a part of those that call it."""
    return Compiled(function, inline=True)


def fused(function: Callable) -> Compiled:
    """Compile a function as `inlined` does, where a·b + c may be rounded once."""
    return Compiled(function, inline=True, fused=True)


GATHERED: ContextVar[set[str] | None] = ContextVar("GATHERED", default=None)
"""What is gathered so far; None where nobody does."""


@contextmanager
def gathers() -> Iterator[set[str]]:
    """Give the names of what filters that are made inside have to compile, and do not yet."""
    names: set[str] = set()
    token = GATHERED.set(names)
    try:
        yield names
    finally:
        GATHERED.reset(token)


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
def cache_folder() -> Path | None:
    """
    Return the folder for compiled code, made if need be; None if nothing can be written there.

    ``FLEXAXIS_COMPILED`` or ``NUMBA_CACHE_DIR`` if that is set, else ``flexaxis`` in the user's
    cache folder. It holds code: one that belongs to another user is not used.
    """
    given = os.environ.get("FLEXAXIS_COMPILED") or os.environ.get("NUMBA_CACHE_DIR")
    try:
        folder = Path(given) if given else user_cache() / "flexaxis" / "compiled"
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        if hasattr(os, "getuid") and folder.stat().st_uid not in {0, os.getuid()}:
            return None
    except (OSError, RuntimeError):  # RuntimeError: a user without a home
        return None
    return folder


def user_cache() -> Path:
    """Return the folder in which this system's user keeps what can be made again."""
    if folder := os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA"):
        return Path(folder)
    return Path("~/Library/Caches" if sys.platform == "darwin" else "~/.cache").expanduser()


TOLD = 1.0  # s of waiting for another process after which the user hears of it
PATIENCE = 60.0  # s, longer than a loop takes to compile: who holds it then may have been stopped
PAUSE = 0.02  # s between two looks
VECTORS = (0, 68)  # the numba from which on they are faster: with 0.61 `imm` takes 7 times as long


def _load(name: str, text: str, folder: Path | None) -> tuple[Any, Path | None]:
    """
    Return a function of a module, for numba to compile, and the file; None if it is kept nowhere.

    Parameters
    ----------
    name : str
        Of the function.
    text : str
        Of the module.
    folder : Path or None
        Where the module is kept, and what numba makes of it; None for nowhere.
    """
    import numba

    path = folder / f"flexaxis_{name}_{digest(text, numba.__version__)}.py" if folder else None
    if path is None or not _kept(path, text):
        return getattr(_unkept(name, text), name), None
    return getattr(_imported(path), name), path


def _remove(function: Any) -> None:
    """Remove what numba keeps of a function, which nobody can read."""
    for path in Path(function.stats.cache_path).glob(f"*.{function.__name__}-*.nb?"):
        with suppress(OSError):
            path.unlink()


def _kept(path: Path, text: str) -> bool:
    """Write a module unless it is there; return whether it is there then."""
    with suppress(OSError, UnicodeError):
        if path.read_text(encoding="utf-8") == text:
            return True
    aside = path.with_suffix(f".{os.getpid()}")
    try:
        aside.write_text(text, encoding="utf-8")
        os.replace(aside, path)
    except OSError:  # a full disk
        with suppress(OSError):
            aside.unlink(missing_ok=True)
        return False
    return True


def _imported(path: Path) -> ModuleType:
    if path.stem not in sys.modules:
        spec = spec_from_file_location(path.stem, path)
        assert spec is not None and spec.loader is not None
        module = sys.modules[path.stem] = module_from_spec(spec)
        spec.loader.exec_module(module)
    return sys.modules[path.stem]


def _unkept(name: str, text: str) -> ModuleType:
    module = ModuleType(f"flexaxis_{name}")
    exec(text.replace("cache=True, ", ""), vars(module))
    return module


DONE = ".compiled"
"""Ends the name of the empty file beside a module that says that it is compiled."""


def _is_done(path: Path | None) -> bool:
    return path is not None and path.with_suffix(DONE).exists()


@contextmanager
def _first_call(path: Path | None, label: str) -> Iterator[None]:
    """
    Tell the user what is compiled in a first call, and let other processes wait for it.

    Parameters
    ----------
    path : Path or None
        Of the module.
    label : str
        What it is.
    """
    with _claimed(path, label):
        if _is_done(path):
            yield
            return
        done = path and path.with_suffix(DONE)
        where = f"once, into {done.parent}" if done else "as no cache folder can be written"
        print(f"flexaxis: compiling {label} {where} …", file=sys.stderr, flush=True)
        with _all_for_speed():
            yield
        if done:
            with suppress(OSError):
                done.touch()


@contextmanager
def _all_for_speed() -> Iterator[None]:
    """Let numba make vector instructions of lanes that are written out, and take no longer."""
    import numba

    config: Any = numba.config
    before, collecting = config.SLP_VECTORIZE, gc.isenabled()
    version = tuple(int(part) for part in numba.__version__.split(".")[:2])
    config.SLP_VECTORIZE = int(version >= VECTORS)
    gc.disable()  # looking for garbage takes a sixth of the time, and finds next to none
    try:
        yield
    finally:
        config.SLP_VECTORIZE = before
        if collecting:
            gc.enable()


@contextmanager
def _claimed(path: Path | None, label: str) -> Iterator[None]:
    """
    Hold what nobody else holds meanwhile; first wait for it, but not for ever.

    Where files cannot be locked several processes may compile the same.
    """
    try:
        import fcntl

        claim = path.open("rb") if path else None
    except (ImportError, OSError):
        claim = None
    if claim is None:
        yield
        return
    began, told = time.monotonic(), False
    with claim:
        while (waited := time.monotonic() - began) <= PATIENCE:
            try:
                fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if waited > TOLD and not told:
                    words = f"flexaxis: waiting for another process to compile {label} …"
                    print(words, file=sys.stderr, flush=True)
                    told = True
                time.sleep(PAUSE)
            except OSError:
                break
        yield
