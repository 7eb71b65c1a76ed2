"""Estimators that compute the physical parameters of an axis from torque and either speed or angle.

The modules in `estimators` never read the true parameters and import no other package of the suite,
so the estimators also run on logs of a real axis. An estimator receives the torque u[k], the output
y[k] and the prior knowledge that `problem` describes. An estimator returns the parameter estimate
θ[k] and the detected parameter changes, as `protocol` specifies. The package `models` contains
models of axes. `filters` and `glr` process samples one by one, and `offline` processes whole
records. `methods` contains the estimators, and `registry` lists the estimators by name.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axis_models import one_mass, three_mass, two_mass
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.signals import increment

if TYPE_CHECKING:
    from flexaxis.estimators.methods.baselines import Frozen
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
    "Frozen": "methods.baselines",
    "Rpem": "methods.rpem",
}


def __getattr__(name: str) -> object:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_LATER[name]}"), name)


class _Listing(ModuleType):
    """Module type that makes `flexaxis.estimators` callable; a call lists the estimators."""

    def __call__(self, *, find: str = "") -> list[dict[str, str]]:
        """Return name and card (summary) of each estimator whose name or card contains ``find``."""
        from flexaxis.estimators.registry import REGISTRY

        lines = [{"name": entry.name, "card": entry.summary} for entry in REGISTRY.values()]
        return [line for line in lines if find.lower() in " ".join(line.values()).lower()]


sys.modules[__name__].__class__ = _Listing
