"""What an estimator may know of an axis before its first sample: plain values, and no truth.

It is offered by keyword, of what its constructor takes.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axes import MODELS
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.building.guest import is_guest
from flexaxis.models_mjcf import DEFAULT
from flexaxis.sim.errors import did_you_mean
from flexaxis.sim.parameters import LAW_NAMES

if TYPE_CHECKING:
    from flexaxis.experiments.building.estimator_text import Spec
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
    model : str
        Of the plant, and of `flexaxis.estimators.models.axes.MODELS`.
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
    model: str
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
        from flexaxis.estimators.offline.priors import stored_P

        return stored_P(self._made, self.identify, self.period, forgetting=None) is not None

    @property
    def _made(self) -> Model:
        return MODELS[self.model].factory(self.nominal)

    def axis(self, text: str) -> dict[str, float] | Model:
        """Return what an estimator is made of: nominal values, or a shipped one's model.

        Of values alone, shipped ones make the paper's axis.
        """
        values = self.model == DEFAULT or is_guest(text)
        return dict(self.nominal) if values else self._made

    def as_data(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return {
            "name": self.name,
            "model": self.model,
            "nominal": dict(self.nominal),
            "period": self.period,
            "identify": list(self.identify),
            "output": self.output,
            "noise": self.noise,
        }


def offer_of(scenario: Scenario) -> Offer:
    """Return what a scenario tells an estimator; ScenarioError where that has no model of it."""
    from flexaxis.experiments.scoring.parameter_names import check_model, started_nominal

    check_model(scenario)
    return Offer(
        name=scenario.name,
        model=scenario.model,
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


class Misfit(EstimatorError):
    """An estimator and a scenario that do not go together, though each is right."""


def offered_to(
    spec: Spec, offer: Offer, torques: Torques, *, onsets: Sequence[int] = ()
) -> dict[str, Any]:
    """Return what an estimator is offered besides nominal values and period, by keyword.

    Arguments as of `build_of`; EstimatorError if nothing is asked that it could estimate.
    """
    asked = _asked(spec, offer)
    offered: dict[str, Any] = {"identify": asked, "output": offer.output}
    if offer.noise is not None:
        offered["noise"] = offer.noise
    if spec.make is REGISTRY["oracle-reset"].factory:  # the control alone is told when
        offered["onsets"] = tuple(onsets)
    wanted = "torque" in keywords(spec.make) and "P0" not in spec.options
    stored = replace(offer, identify=asked).has_prior
    if wanted and has_laws(spec.make):  # friction is of the size of the torque
        offered["torque"] = torques("design")
    elif wanted and (is_guest(spec.text) or not stored):
        offered["torque"] = torques("reference")
    return offered


def keywords(make: Callable[..., Any], name: str = "") -> set[str]:
    """Return what may be given to a constructor by keyword, besides nominal values and period.

    Raises
    ------
    EstimatorError
        If it takes none of these, as a number, or a class in C; it says its name.
    """
    try:
        parameters = list(inspect.signature(make).parameters.values())[2:]
    except (TypeError, ValueError) as error:
        raise EstimatorError(
            f"{name} cannot be made like an estimator, from nominal values and a period: {error}"
        ) from error
    return {p.name for p in parameters if p.kind in (p.KEYWORD_ONLY, p.POSITIONAL_OR_KEYWORD)}


def has_laws(make: Callable[..., Any]) -> bool:
    """Return whether an estimator can be asked for parameters of friction and other laws."""
    entry = next((entry for entry in REGISTRY.values() if entry.factory is make), make)
    return bool(getattr(entry, "laws", False))


def _asked(spec: Spec, offer: Offer) -> tuple[str, ...]:
    """Return what an estimator is asked to identify: what is of no law, unless it has `laws`."""
    if has_laws(spec.make):
        return offer.identify
    if not offer.linear:
        raise Misfit(
            f"{spec.text} does not declare `laws`, and {offer.name} asks for nothing but "
            f"{', '.join(offer.identify)}: leave the scenario out"
        )
    return offer.linear


class UnknownParameter(KeyError):
    """No parameter has this name, or it is not told; says which is nearest."""

    def __str__(self) -> str:
        return str(self.args[0])


class Nominal(dict[str, float]):
    """Nominal values by parameter, as a user's estimator is given them: it knows what was meant."""

    def __missing__(self, name: str) -> float:
        """Refuse a name that is not there."""
        hint = did_you_mean(str(name), self)
        raise UnknownParameter(f"nominal has no {name!r}.{hint} It has: {', '.join(self)}")
