"""What an estimator may know of an axis before its first sample: plain values, and no truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.theta import started_nominal
from flexaxis.sim.law_parameters import LAW_NAMES
from flexaxis.sim.parameters import PARAMETER_NAMES
from flexaxis.sim.scenario import Scenario

Torque = Literal["design", "reference"]
"""Of the axis as it was designed, or of the scenario's own at nominal parameters."""
Torques = Callable[[Torque], NDArray[np.float64]]


@dataclass(frozen=True, kw_only=True)
class Offer:
    """What is offered to an estimator.

    Attributes
    ----------
    name : str
        Of the scenario, for messages.
    nominal : mapping of str to float
        Parameters as they are told, those to be identified off by `start`, and the data sheet.
    period : float
        [s].
    identify : tuple of str
        Parameters that are asked for, those of laws included.
    output : str
    noise : float or None
        Standard deviation of the output, where the data sheet tells it.
    """

    name: str
    nominal: Mapping[str, float]
    period: float
    identify: tuple[str, ...]
    output: str
    noise: float | None

    @property
    def linear(self) -> tuple[str, ...]:
        """What is asked of an estimator that knows no laws."""
        return tuple(name for name in self.identify if name not in LAW_NAMES)

    @property
    def has_prior(self) -> bool:
        """Whether P(0) is among the data stored with the estimators."""
        from flexaxis.estimators.models.axes import three_mass
        from flexaxis.estimators.offline.priors import stored_P

        model = three_mass({name: self.nominal[name] for name in PARAMETER_NAMES})
        return stored_P(model, self.identify, self.period, forgetting=None) is not None

    def as_data(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return {
            "name": self.name,
            "nominal": dict(self.nominal),
            "period": self.period,
            "identify": list(self.identify),
            "output": self.output,
            "noise": self.noise,
        }


def offer_of(scenario: Scenario) -> Offer:
    """Return what a scenario tells an estimator."""
    return Offer(
        name=scenario.name,
        nominal=started_nominal(scenario),
        period=scenario.period,
        identify=scenario.identify,
        output=scenario.output,
        noise=scenario.data_sheet.get("noise"),
    )


def offer_from(data: Mapping[str, Any]) -> Offer:
    """Return what `Offer.as_data` gave."""
    return Offer(**{**data, "identify": tuple(data["identify"])})


def torque_of(scenario: Scenario, which: Torque) -> NDArray[np.float64]:
    """Return the torque (8000,) [N m] of a nominal reference run."""
    from flexaxis.experiments.scoring.nominal import design_torque, nominal_torque  # the engine

    return design_torque(scenario) if which == "design" else nominal_torque(scenario)
