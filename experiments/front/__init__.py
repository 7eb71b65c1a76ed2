"""flexaxis in Python: ``import flexaxis as fx``; simulate, estimate, score, compare, benchmark.

A name is imported when it is first used: `import flexaxis` itself takes milliseconds. The modules
beside this one are thin; what they call lies in `flexaxis.sim`, `.estimators`, `.experiments`.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what type checkers and completion read; a test compares it with _HOME
    from flexaxis._axis import Axis, Sample, make_axis
    from flexaxis._check import check, scenarios
    from flexaxis._compare import Comparison, compare
    from flexaxis._estimates import Estimate
    from flexaxis._logs import LogResult, identify, import_log, track, trend
    from flexaxis._look import cache, view
    from flexaxis._records import Recording, load, simulate
    from flexaxis._results import Results, benchmark, study
    from flexaxis._running import estimate, score

    __version__: str

__all__ = [
    "Axis",
    "Comparison",
    "Estimate",
    "LogResult",
    "Recording",
    "Results",
    "Sample",
    "__version__",
    "benchmark",
    "cache",
    "check",
    "compare",
    "estimate",
    "estimators",
    "identify",
    "import_log",
    "load",
    "make_axis",
    "scenarios",
    "score",
    "simulate",
    "study",
    "track",
    "trend",
    "view",
]

_HOME = {
    "Axis": "_axis",
    "Sample": "_axis",
    "make_axis": "_axis",
    "check": "_check",
    "Comparison": "_compare",
    "compare": "_compare",
    "Estimate": "_estimates",
    "estimate": "_running",
    "score": "_running",
    "scenarios": "_check",
    "Recording": "_records",
    "load": "_records",
    "simulate": "_records",
    "Results": "_results",
    "benchmark": "_results",
    "study": "_results",
    "LogResult": "_logs",
    "identify": "_logs",
    "import_log": "_logs",
    "track": "_logs",
    "trend": "_logs",
    "cache": "_look",
    "view": "_look",
}
_PACKAGES = ("estimators", "experiments", "models_mjcf", "sim")


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
        """Return the registered estimators, those with some text in name or summary."""
        from flexaxis._check import estimators

        return estimators(find=find)


class _Front(ModuleType):
    """The front door, where one name is both: the package `estimators` and what lists them."""

    def __setattr__(self, name: str, value: object) -> None:
        if name == "estimators" and isinstance(value, ModuleType):  # the import system sets it
            value.__class__ = _Listed
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Front
