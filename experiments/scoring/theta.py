"""What θ means: between the names that are estimated and the physical parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexaxis.sim.parameters import PARAMETER_NAMES
from flexaxis.sim.scenario import Scenario


def physical(name: str) -> tuple[str, int]:
    """Return the physical parameter and the exponent of an estimated one: "1/J_a" → J_a, −1."""
    return (name[2:], -1) if name.startswith("1/") else (name, 1)


def true_theta(names: Sequence[str], parameters: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the true values (…, p) of estimated parameters from the physical ones (…, 12)."""
    columns = [physical(name) for name in names]
    return np.stack(
        [parameters[..., PARAMETER_NAMES.index(p)] ** float(e) for p, e in columns], axis=-1
    )


def started_nominal(scenario: Scenario) -> dict[str, float]:
    """Return the nominal values that an estimator is told.

    Those to be identified are off by `start`, and the others by `told`.
    """
    values = scenario.nominal.as_dict()
    for parameter, factor in (scenario.told or {}).items():
        values[parameter] *= factor
    for name in scenario.identify:
        parameter, exponent = physical(name)
        values[parameter] *= scenario.start ** float(exponent)
    return values


def started_theta(scenario: Scenario, names: Sequence[str]) -> NDArray[np.float64]:
    """Return θ(0) (p,) of an estimator that starts where it is told to."""
    told = started_nominal(scenario)
    return true_theta(names, np.array([told[name] for name in PARAMETER_NAMES]))
