"""Modules of generated source, kept in files named after their content, or nowhere."""

import gc
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from flexaxis.estimators.models.source import digest

TOLD = 1.0  # s of waiting for another process after which the user hears of it
PATIENCE = 60.0  # s, longer than a loop takes to compile: who holds it then may have been stopped
PAUSE = 0.02  # s between two looks
VECTORS = (0, 68)  # the numba from which on they are faster: with 0.61 `imm` takes 7 times as long


class Loaded(NamedTuple):
    """
    A function of a module of generated source.

    Attributes
    ----------
    function : callable
        What numba compiles when it is called.
    path : Path or None
        File of the module; None where it is kept nowhere.
    """

    function: Any
    path: Path | None


def load(name: str, text: str, folder: Path | None) -> Loaded:
    """
    Return a function of a module.

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
        return Loaded(getattr(_unkept(name, text), name), None)
    return Loaded(getattr(_imported(path), name), path)


def remove(function: Any) -> None:
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


@contextmanager
def first_call(loaded: Loaded, label: str) -> Iterator[None]:
    """
    Tell the user what is compiled in a first call, and let other processes wait for it.

    Parameters
    ----------
    loaded : Loaded
    label : str
        What it is.
    """
    with _claimed(loaded.path, label):
        done = loaded.path and loaded.path.with_suffix(".compiled")
        if done and done.exists():
            yield
            return
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
