"""The Python interface of flexaxis: simulate, estimate, score, compare and benchmark.

Import the package with ``import flexaxis as fx``. The import takes only milliseconds, because each
function is loaded on its first use. Most functions in this folder are thin wrappers around
functions from `flexaxis.sim`, `flexaxis.estimators` and `flexaxis.experiments`.
"""

from importlib import import_module
from importlib.metadata import version
from typing import Any

__version__ = version("flexaxis")
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
    "tune",
    "view",
]

_NAMES = {
    "_estimates": ("Estimate", "check", "estimate", "score"),
    "_logs": ("LogResult", "identify", "import_log", "track"),
    "_records": ("Axis", "Recording", "Sample", "cache", "load", "make_axis", "simulate"),
    "_results": ("Comparison", "Results", "benchmark", "compare", "study", "tune"),
    "experiments.demo.view": ("view",),
    # The following names are used only by the command line.
    "experiments.catalogue.card": ("show",),
    "experiments.catalogue.find": ("GROUPS", "check_names", "faults", "scenarios", "suites"),
    "experiments.check.template": ("new",),
    "experiments.demo.serve": ("serve",),
    "experiments.paper.reproduce": ("reproduce",),
    "experiments.studies.benchmark": ("merge", "plan"),
}
_HOME = {name: module for module, names in _NAMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name == "estimators":
        return import_module(f"{__name__}.{name}")
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}", name=name)
    globals()[name] = result = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    return result


def __dir__() -> list[str]:
    return __all__
