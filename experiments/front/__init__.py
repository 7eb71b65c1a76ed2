"""flexaxis in Python: ``import flexaxis as fx``; simulate, estimate, score, compare, benchmark.

A name is imported when it is first used: `import flexaxis` itself takes milliseconds. The modules
beside this one are thin; what they call lies in `flexaxis.sim`, `.estimators`, `.experiments`.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what type checkers and completion read; a test compares it with _NAMES
    from flexaxis._axis import Axis, Sample, make_axis
    from flexaxis._estimates import Estimate, estimate, score
    from flexaxis._logs import LogResult, identify, import_log, track
    from flexaxis._records import Recording, cache, load, simulate, view
    from flexaxis._results import Comparison, Results, benchmark, check, compare, study, tune
    from flexaxis.experiments.catalogue.find import scenarios

    __version__: str

_NAMES = {
    "_axis": ("Axis", "Sample", "make_axis"),
    "_estimates": ("Estimate", "estimate", "score"),
    "_logs": ("LogResult", "identify", "import_log", "track"),
    "_records": ("Recording", "cache", "load", "simulate", "view"),
    "experiments.catalogue.find": ("scenarios",),
    "_results": ("Comparison", "Results", "benchmark", "check", "compare", "study", "tune"),
}
_HOME = {name: module for module, names in _NAMES.items() for name in names}
_PACKAGES = ("estimators", "experiments", "models_mjcf", "sim")
__all__ = sorted((*_HOME, "__version__", "estimators"))  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name in _HOME:
        found = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    elif name in _PACKAGES:
        found = import_module(f"{__name__}.{name}")
    elif name == "__version__":
        from importlib.metadata import version

        found = version(__name__)
    else:
        raise AttributeError(_unknown(name))
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted(__all__)


def _unknown(name: str) -> str:
    from difflib import get_close_matches

    near = get_close_matches(name, __all__, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return f"module {__name__!r} has no attribute {name!r}{hint}"


class _Listed(ModuleType):
    """The package of estimators, which lists them when it is called: `fx.estimators()`."""

    def __call__(self, *, find: str = "") -> Any:
        """Return the registered estimators, those with some text: a list of name and card."""
        from flexaxis.experiments.catalogue.find import estimators

        return estimators(find)


class _Front(ModuleType):
    """The front door, where one name is both: the package `estimators` and what lists them."""

    def __setattr__(self, name: str, value: object) -> None:
        if name == "estimators" and isinstance(value, ModuleType):  # the import system sets it
            value.__class__ = _Listed
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Front
