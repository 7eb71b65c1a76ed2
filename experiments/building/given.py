"""Estimators of this session: a class typed in a notebook or a script, under its own name."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any
from uuid import uuid4

from flexaxis.estimators.errors import EstimatorError

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
