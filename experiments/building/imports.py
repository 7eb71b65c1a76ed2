"""Importing a user's code: a module by name, or a file with its neighbours."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from functools import lru_cache
from hashlib import sha256
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building.guest import hosted
from flexaxis.sim.errors import did_you_mean


def no_file(path: Path) -> EstimatorError:
    """Return the error for a file of an estimator that is not there, with those that are."""
    there = sorted(f.name for f in path.parent.glob("*.py")) if path.parent.is_dir() else []
    return EstimatorError(
        f"{path} cannot be imported: there is no such file.{did_you_mean(path.name, there)}"
    )


def module_of(name: str) -> Any:
    """Return the module of a name, or of a path to a file.

    Raises
    ------
    EstimatorError
        If there is none, or it cannot be imported.
    """
    if not name.endswith(".py"):
        return imported(name, lambda: importlib.import_module(name))
    return imported(name, lambda: _file(Path(name).resolve()))


def class_of(module: str, name: str, attribute: str) -> Any:
    """Return what a module has under a name; `name` is what the whole is called in messages.

    Raises
    ------
    EstimatorError
        If there is none, or the module cannot be imported.
    """
    home, called = module_of(module), name.rpartition(":")[0]
    if (found := getattr(home, attribute, None)) is None:
        classes = [each for each, value in vars(home).items() if isinstance(value, type)]
        raise EstimatorError(
            f"{name}: {called} has no {attribute!r}.{did_you_mean(attribute, classes)}"
        )
    return found


def imported(name: str, load: Callable[[], Any]) -> Any:
    """Import a user's code; whatever goes wrong in it is the user's to read, in one line."""
    try:
        with hosted(f"{name}:", "when it was imported", guest=True):
            return load()
    except EstimatorError as error:
        cause = error.__cause__ or error
        told = f"{type(cause).__name__}: {cause}" if error.__cause__ else str(error)
        raise EstimatorError(f"{name} cannot be imported: {told}{_hidden(name, cause)}") from error


@lru_cache
def _file(path: Path) -> Any:
    if str(path.parent) not in sys.path:  # at its end: no neighbour takes the place of a library
        sys.path.append(str(path.parent))
    name = f"_flexaxis_file_{sha256(str(path).encode()).hexdigest()[:12]}_{path.stem}"
    spec = spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None  # a .py file always has both
    sys.modules[name] = module = module_from_spec(spec)  # dataclasses look for theirs there
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _hidden(name: str, error: BaseException) -> str:
    """Return which neighbours of a file have names of Python's own modules, which go before."""
    missed = isinstance(error, ImportError | AttributeError)  # as what was not meant would be
    if not missed or not name.endswith(".py"):
        return ""
    near = sorted(f.name for f in Path(name).resolve().parent.glob("*.py"))
    taken = [file for file in near if file.removesuffix(".py") in sys.stdlib_module_names]
    if not taken:
        return ""
    return f" ({', '.join(taken)} beside it cannot be imported: Python has its own; rename it)"
