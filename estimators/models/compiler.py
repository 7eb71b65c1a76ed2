"""
The one decorator for all that numba compiles: on first use, kept for good, and never stale.

`compiled` and `inlined` mark functions. Nothing is imported or compiled before one of them is
called. Then it is written, with all that it reaches, into a module of its own, which numba compiles
and keeps by what it documents, ``njit(cache=True)``. The module is named after its content, in the
user's cache folder: an edit of any function that is reached, or of a constant in it, makes another
module, and nothing else does.
"""

import os
import pickle
import sys
import tempfile
from collections.abc import Callable
from functools import cached_property, lru_cache, update_wrapper, wraps
from pathlib import Path
from typing import Any

from flexaxis.estimators.models.cache import Loaded, first_call, load, remove
from flexaxis.estimators.models.source import Rendered, rendered, written


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
        with first_call(self._loaded, self.label):
            try:
                result = self.dispatcher(*arguments)
            except (EOFError, pickle.UnpicklingError, ImportError, AttributeError):
                # what is kept of it is torn, or names types of another version of flexaxis
                remove(self.dispatcher)
                result = self.dispatcher(*arguments)
        self._called = True
        return result

    def __reduce__(self) -> str | tuple:
        # a function of a module goes by its name, one made for a pattern by what made it
        if self.origin is not None:
            return self.origin
        assert callable(self.function)
        return self.function.__qualname__

    @cached_property
    def rendered(self) -> Rendered:
        """Its source, under a name that no other function has."""
        return rendered(self)

    @cached_property
    def dispatcher(self) -> Any:
        """What numba calls a compiled function, for Python to call."""
        return self._loaded.function

    @cached_property
    def _loaded(self) -> Loaded:
        return load(self.rendered.name, written(self), cache_folder())


def compiled(function: Callable) -> Compiled:
    """Compile a function on its first call, and keep the result."""
    return Compiled(function)


def inlined(function: Callable) -> Compiled:
    """Compile a function as a part of those that call it."""
    return Compiled(function, inline=True)


def fused(function: Callable) -> Compiled:
    """Compile a function as `inlined` does, where a·b + c may be rounded once."""
    return Compiled(function, inline=True, fused=True)


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
