"""The estimators by name: modules of methods/, its rules/ and relocate/ bring their own entries."""

import pkgutil
from collections.abc import Iterator, Mapping
from functools import lru_cache
from importlib import import_module
from types import ModuleType

from flexaxis.estimators import methods, relocate
from flexaxis.estimators.entry import Entry
from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.methods import rules
from flexaxis.estimators.models.axes import PAPER

__all__ = ["DEFAULT_IDENTIFY", "REGISTRY", "Entry", "entry"]

DEFAULT_IDENTIFY = PAPER


def entry(name: str) -> Entry:
    """
    Return the registered estimator of this name.

    Raises
    ------
    EstimatorError
        If there is none, with the nearest name.
    """
    if name not in REGISTRY:
        raise EstimatorError(f"unknown estimator {name!r}: {did_you_mean(name, REGISTRY)}")
    return REGISTRY[name]


class _Registry(Mapping[str, Entry]):
    """Entries by name, in the order of their rank; read when first asked for."""

    def __getitem__(self, name: str) -> Entry:
        return _entries()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(_entries())

    def __len__(self) -> int:
        return len(_entries())


REGISTRY: Mapping[str, Entry] = _Registry()
"""All registered estimators: every `ENTRIES` of a module of the folders above."""


@lru_cache
def _entries() -> Mapping[str, Entry]:
    found = [e for folder in (methods, rules, relocate) for e in _of(folder)]
    return {e.name: e for e in sorted(found, key=lambda e: e.rank)}


def _of(folder: ModuleType) -> Iterator[Entry]:
    for module in pkgutil.iter_modules(folder.__path__, folder.__name__ + "."):
        if not module.ispkg:
            yield from getattr(import_module(module.name), "ENTRIES", ())
