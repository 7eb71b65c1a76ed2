"""The estimators by name: modules of methods/ and its rules/ bring their own entries."""

import pkgutil
from collections.abc import Iterator, Mapping
from functools import lru_cache
from importlib import import_module
from types import ModuleType

from flexaxis.estimators import methods
from flexaxis.estimators.entry import Entry
from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.methods import rules
from flexaxis.estimators.models.axes import PAPER

__all__ = ["DEFAULT_IDENTIFY", "GONE", "REGISTRY", "Entry", "gone"]

DEFAULT_IDENTIFY = PAPER

GONE = {
    "relocate": ("glr", "d318435"),
    "relocate-friction": ("glr", "d318435"),
    "imm-friction": ("glr", "d318435"),
}
"""Estimators that are gone: who does their work now, and the last commit that had them."""


def gone(name: str) -> str | None:
    """
    Return what to say of an estimator that is gone, in a line; None of any other name.

    Examples
    --------
    >>> gone("relocate")
    "estimator 'relocate' is gone: it is 'glr' now; the last commit with it is d318435"
    """
    if name not in GONE:
        return None
    now, commit = GONE[name]
    return f"estimator {name!r} is gone: it is {now!r} now; the last commit with it is {commit}"


class _Unknown(EstimatorError, KeyError):
    """No estimator has this name: what a mapping raises, in words for a user."""

    __str__ = Exception.__str__  # not the repr, as of a KeyError


class _Registry(Mapping[str, Entry]):
    """Entries by name, in the order of their rank; read when first asked for."""

    def __getitem__(self, name: str) -> Entry:
        if name not in _entries():
            raise _Unknown(
                gone(name) or f"unknown estimator {name!r}: {did_you_mean(str(name), _entries())}"
            )
        return _entries()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(_entries())

    def __len__(self) -> int:
        return len(_entries())


REGISTRY: Mapping[str, Entry] = _Registry()
"""
All registered estimators: every `ENTRIES` of a module of the folders above.

A name that is not there raises an error that is an `EstimatorError` and a `KeyError`.
"""


@lru_cache
def _entries() -> Mapping[str, Entry]:
    found = [e for folder in (methods, rules) for e in _of(folder)]
    return {e.name: e for e in sorted(found, key=lambda e: e.rank)}


def _of(folder: ModuleType) -> Iterator[Entry]:
    for module in pkgutil.iter_modules(folder.__path__, folder.__name__ + "."):
        if not module.ispkg:
            yield from getattr(import_module(module.name), "ENTRIES", ())
