"""Estimators of physical parameters from torque and motor angle or speed.

Nothing here imports the rest of the package or knows the true parameters, so that the estimators
run on logs of a real axis as well. The input is u[k], y[k] and prior knowledge (`problem`), the
output θ[k] and findings (`protocol`). `models` describes axes; `filters` and `glr` process samples
one by one, `offline` whole records; `methods` has the estimators, `registry` lists them by name.
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

# numba and scipy take most of a second to import, so modules that need them are loaded on use
_LATER = {
    "Frozen": "methods.controls",
    "Rpem": "methods.rpem",
}


def __getattr__(name: str) -> object:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_LATER[name]}"), name)


class _Listing(ModuleType):
    """The package; a call lists the registered estimators."""

    def __call__(self, *, find: str = "") -> list[dict[str, str]]:
        """Return name and card of the registered estimators that contain a text."""
        from flexaxis.estimators.registry import REGISTRY

        lines = [{"name": entry.name, "card": entry.summary} for entry in REGISTRY.values()]
        return [line for line in lines if find.lower() in " ".join(line.values()).lower()]


sys.modules[__name__].__class__ = _Listing
