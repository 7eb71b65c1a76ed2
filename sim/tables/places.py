"""Where the engine keeps parameters of the axis and of its laws, for each run of a batch."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Place(NamedTuple):
    """Where the engine keeps a number: field of its model, named object, column if it has some."""

    field: str
    owner: str
    column: int | None = None


Kept = Callable[[Mapping[str, Any]], dict[Place, Any]]
"""Returns for parameters of a law where the engine keeps them, and as what."""

# Of the six transmission ratios of an actuator only the first acts on a hinge; of the inertias all
# three stay equal, so that they belong to a possible body.
_FIELDS = {
    "J": "body_inertia", "k": "tendon_stiffness", "d": "tendon_damping", "f": "dof_damping",
}  # fmt: skip
_KINDS = {"dof": "joint", "actuator": "actuator"}


def parameter_places(batch: Any, names: Sequence[str]) -> Iterator[Array]:
    """Yield, for each parameter, the live array (R, ...) of the engine that holds it.

    Those of a kind have the order of bodies and tendons.
    """
    seen = Counter({"J": 1})  # the first body is the world
    for name in names:
        if name == "k_T":
            yield batch.expand("actuator_gear")[:, 0, 0]
        elif name == "r":  # the coefficient of the motor in the first tendon
            yield batch.expand("wrap_prm")[:, 0]
        else:
            yield batch.expand(_FIELDS[name[0]])[:, seen[name[0]]]
            seen[name[0]] += 1


def _place(batch: Any, model: Any, place: Place) -> Array:
    """Return the live array (R, ...) of the engine that holds what is kept in a place."""
    values: Array = batch.expand(place.field)
    match place.field:
        case "numeric_data":  # all custom numbers, one after the other
            return values[:, model.numeric_adr[model.numeric(place.owner).id] + place.column]
    kind = _KINDS[place.field.split("_", maxsplit=1)[0]]
    rows = values[:, getattr(model, kind)(place.owner).id]
    return rows if place.column is None else rows[:, place.column]


class CubicSprings:
    """Springs whose law is cubic: with their stiffness, all of the law scales."""

    def __init__(self, batch: Any, model: Any) -> None:
        self._ratio = model.tendon_stiffnesspoly / model.tendon_stiffness[:, None]
        self._linear: Array = batch.expand("tendon_stiffness")
        self._higher: Array = batch.expand("tendon_stiffnesspoly")

    def scale(self) -> None:
        """Make the higher coefficients what the linear ones, changed meanwhile, ask for."""
        self._higher[...] = self._linear[..., None] * self._ratio


class KeptLaw:
    """A law in the engine: what its parameters are now, and where the engine keeps them."""

    def __init__(self, batch: Any, model: Any, law: Mapping[str, float], kept: Kept) -> None:
        self._now: dict[str, float | Array] = dict(law)
        self._kept = kept
        self._places = {at: _place(batch, model, at) for at in self._kept(self._now)}

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters of the law."""
        return tuple(self._now)

    def set(self, name: str, values: float | Array) -> None:
        """Set a parameter to a value for all runs, or to values (R,)."""
        self._now[name] = values
        for place, value in self._kept(self._now).items():
            self._places[place][...] = value
