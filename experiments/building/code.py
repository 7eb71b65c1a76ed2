"""Code: classes of this session under their names, and digests of what ran, flexaxis itself too."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from uuid import uuid4

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building.consent import names_code, piped
from flexaxis.experiments.building.neighbours import content_of, imported_neighbours
from flexaxis.experiments.storage.files import SHORT, digest_of


def digest(estimator: str) -> str | None:
    """Return a digest of the files that an estimator names, None for a registered one.

    That is the file of ``path.py:Class`` with what it imports from its folder, the file of
    ``module:Class``, and of ``pipe:COMMAND`` every word of the command that is a file here. What
    the latter two import or call in turn is not looked at. A file that was imported here is as it
    was then.

    Parameters
    ----------
    estimator : str
        As for `--estimator`.
    """
    if is_given(estimator):
        return sha256(written(estimator.partition("[")[0].strip())).hexdigest()[:SHORT]
    if not names_code(estimator):
        return None
    content = b"".join(content_of(path) for path in _named(estimator))
    return sha256(content).hexdigest()[:SHORT]


def _named(estimator: str) -> list[Path]:
    if command := piped(estimator):
        return [Path(word) for word in shlex.split(command)]
    module = estimator.partition("[")[0].rpartition(":")[0]
    if module.endswith(".py"):
        return [Path(module), *imported_neighbours(Path(module).resolve())]
    try:
        found = find_spec(module)
    except (ImportError, ValueError):  # it does not exist: said where it is to be built
        return []
    return [Path(found.origin)] if found and found.origin else []


def own_digest() -> str:
    """Return a digest of the code of simulation, estimators and scores."""
    return digest_of("models_mjcf", "sim", "estimators", "experiments.scoring")


_HELD: dict[str, Callable[..., Any]] = {}
_UNSEEN: dict[str, tuple[Callable[..., Any], bytes]] = {}


def give(make: Callable[..., Any]) -> str:
    """Return the text that names a class: that of its module, or its own name in this session.

    A class of a module that any process can import goes by ``module:Class``. One of a notebook,
    a script or a function is kept here under its name, and a new one takes its place.

    Raises
    ------
    EstimatorError
        If it has no name, or that of a registered estimator.
    """
    from flexaxis.estimators.registry import REGISTRY

    name = getattr(make, "__name__", "")
    if not name.isidentifier():
        raise EstimatorError(f"{make!r} has no name to stand in results: give a class")
    module = getattr(make, "__module__", "__main__")
    held = getattr(sys.modules.get(module), name, None)
    if module != "__main__" and held is make and getattr(sys.modules[module], "__spec__", None):
        return f"{module}:{name}"
    if name in REGISTRY:
        raise EstimatorError(f"{name} is the name of a registered estimator: rename the class")
    _HELD[name] = make
    return name


def is_given(text: str) -> bool:
    """Whether an estimator's text names a class of this session."""
    return text.partition("[")[0].strip() in _HELD


def given(name: str) -> Callable[..., Any] | None:
    """Return the class of this session that has a name, None if there is none."""
    return _HELD.get(name)


def written(name: str) -> bytes:
    """Return the text of a class of this session; where it is not known, what no other has."""
    import inspect

    try:
        return inspect.getsource(_HELD[name]).encode() or _unseen(name)
    except (OSError, TypeError):
        return _unseen(name)


def _unseen(name: str) -> bytes:
    """Return a mark of a class whose text cannot be read: of it alone, and of this session."""
    make, mark = _UNSEEN.get(name, (None, b""))
    if make is not _HELD[name]:
        mark = uuid4().bytes
        _UNSEEN[name] = _HELD[name], mark
    return mark
