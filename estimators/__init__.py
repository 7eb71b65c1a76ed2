"""Estimators of physical parameters from torque and motor angle or speed.

Nothing here knows the truth, MuJoCo or the rest of the package: it works on a robot's log as well.
In come u[k], y[k] and what is known beforehand (`problem`), out go θ[k] and findings (`protocol`).
`models` says what an axis is, `filters` and `glr` what is done with it sample by sample, `offline`
looks at whole records; `methods` are the estimators, which `registry` has by name.
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

# numba and scipy take most of a second to import, so what needs them is loaded when it is used
_LATER = {
    "Frozen": "methods.controls",
    "Rpem": "methods.rpem",
}


def __getattr__(name: str) -> object:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_LATER[name]}"), name)


class _Listing(ModuleType):
    """The package, which lists its registered estimators when it is called."""

    def __call__(self, *, find: str = "") -> list[dict[str, str]]:
        """Return name and card of the registered estimators, those that have some text."""
        from flexaxis.estimators.registry import REGISTRY

        lines = [{"name": entry.name, "card": entry.summary} for entry in REGISTRY.values()]
        return [line for line in lines if find.lower() in " ".join(line.values()).lower()]


sys.modules[__name__].__class__ = _Listing
