"""What an estimator is offered when it is made: by keyword, of what its constructor takes."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.building.guest import is_guest
from flexaxis.experiments.building.offer import Offer, Torques

if TYPE_CHECKING:
    from flexaxis.experiments.building.specs import Spec


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


def keywords(make: Callable[..., Any]) -> set[str]:
    """Return what may be given to a constructor by keyword, besides nominal values and period."""
    parameters = list(inspect.signature(make).parameters.values())[2:]
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
