"""Estimators of physical parameters from the torque and the motor's angle or speed.

No module of this subpackage imports the rest of the package or uses the true parameters, so the
estimators also run on logs of a real axis. An estimator uses u[k], y[k] and prior knowledge
(`problem`), and returns θ[k] and detected changes (`protocol`). `models` describes axes, `filters`
and `glr` process samples one by one, and `offline` processes whole records. `methods` contains the
estimators, and `registry` lists them by name.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axes import one_mass, three_mass, two_mass
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.signals import increment

if TYPE_CHECKING:
    from flexaxis.estimators.methods.controls import Frozen
    from flexaxis.estimators.methods.rpem import Rpem

__all__ = [
    "RECOMMENDED",
    "EstimatorError",
    "Frozen",
    "Model",
    "Rpem",
    "increment",
    "one_mass",
    "three_mass",
    "two_mass",
]

RECOMMENDED = "glr"
"""The registered estimator that the suite recommends for a real axis."""

# Importing numba and scipy takes almost a second, so these names are imported on first use
_LATER = {
    "Frozen": "methods.controls",
    "Rpem": "methods.rpem",
}


def __getattr__(name: str) -> object:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_LATER[name]}"), name)


class _Listing(ModuleType):
    """The type of this module: calling the module lists the estimators."""

    def __call__(self, *, find: str = "") -> list[dict[str, str]]:
        """Return the name and card (summary) of each estimator that contains the text ``find``."""
        from flexaxis.estimators.registry import REGISTRY

        lines = [{"name": entry.name, "card": entry.summary} for entry in REGISTRY.values()]
        return [line for line in lines if find.lower() in " ".join(line.values()).lower()]


sys.modules[__name__].__class__ = _Listing
