"""
What the parameters of a model mean, by where they stand rather than by their names.

A coulomb friction is whatever a law has in that role; a viscous one brakes a state by that state
alone; springs and dampers couple states and are divided by an inertia.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axes import MODELS
from flexaxis.estimators.models.formula import multiply_out
from flexaxis.estimators.models.laws import LAWS, Law
from flexaxis.estimators.models.model import Model

LEVELS = ("coulomb", "breakaway", "motor", "external", "motor_slow", "external_slow")
"""Roles of friction that is not there where all of them are zero."""
LEARNT = ("k_g", "J_m", "k_a", "d_g", "d_a")
"""The structure of the three-mass axis, in the order of estimates; that of others follows it."""


def named(laws: Sequence[Law], roles: Sequence[str]) -> tuple[str, ...]:
    """Return the parameters that laws have in some roles, in the order of laws and roles."""
    parameters = (law.parameters.get(role) for law in laws for role in roles)
    return tuple(dict.fromkeys(name for name in parameters if isinstance(name, str)))


def shapes_of_friction(
    model: Model, names: Sequence[str]
) -> dict[tuple[str, ...], tuple[str, ...]]:
    """Return levels of dry friction among names, and what shapes it where one is not zero."""
    shapes = {}
    for law in model.laws:
        levels = [n for n in named([law], LEVELS) if n in names]
        shape = [n for n in law.names if n in names and n not in levels[:1]]
        if LAWS[law.kind].rubs and levels and shape:
            shapes[tuple(levels)] = tuple(shape)
    return shapes


def fixable(model: Model) -> tuple[str, ...]:
    """
    Return what is fixed where the first seconds do not show it: the structure, play and springs.

    Friction is tracked, and cogging shows at any speed.
    """
    roles = [name for kind in LAWS.values() for name, role in kind.roles.items() if role.fixable]
    return (*structure(model), *named(model.laws, roles))


def structure(model: Model) -> tuple[str, ...]:
    """
    Return what of a linear model is computed rather than measured, but does not change in use.

    Springs and dampers between states, and where there are any the inertia on which the input acts,
    which the modes weigh against the others; a single inertia leaves the scale of all torques open.
    """
    used = {name for *_, powers in _terms(model) for name in powers}
    linear = [name for name in model.parameters if name in used]
    springs = [name for name in linear if _couples(model, name)]
    inertias = [name for name in linear if _is_driven(model, name)] if springs else []
    names = [name for name in (*inertias, *springs) if name not in model.fixed]
    return tuple(sorted(names, key=lambda name: [*LEARNT, name].index(name)))


def _couples(model: Model, name: str) -> bool:
    """Return whether a parameter is a spring or a damper: between states, over an inertia."""
    terms = [(i, j, powers) for i, j, powers in _terms(model) if powers.get(name, 0)]
    couples = any(i != j and j < len(model.states) for i, j, _ in terms)
    forces = all(min(powers.values()) < 0 and j < len(model.states) for _, j, powers in terms)
    return couples and forces and _always(model, name, 1)


def _is_driven(model: Model, name: str) -> bool:
    """Return whether the input is divided by a parameter, as by the inertia of a motor."""
    inputs = [powers for _, j, powers in _terms(model) if j == len(model.states)]
    return any(powers.get(name, 0) < 0 for powers in inputs) and _always(model, name, -1)


def _always(model: Model, name: str, power: int) -> bool:
    """Return whether a parameter has the same power wherever it stands."""
    return {p[name] for *_, p in _terms(model) if p.get(name, 0)} == {power}


def _terms(model: Model) -> Iterator[tuple[int, int, Mapping[str, int]]]:
    """Row, column and powers of every term of [A B]."""
    for i, (row, entry) in enumerate(zip(model.A, model.B, strict=True)):
        for j, formula in enumerate((*row, entry)):
            for _, powers in multiply_out(formula):
                yield i, j, powers


NEAR = 2.5
"""
Factor within which the poles agree of a model that moves as a named axis does.

So a start at half or twice the truth is still that axis. The motor of the stress case "n2" coasts
11 times as long as that of "n1".
"""
STARTED = 4.0  # factor by which an identified parameter may start off its nominal value
SAME = 1e-9  # relative, of all other values


def is_axis(model: Model, name: str, identify: Sequence[str]) -> bool:
    """
    Return whether a model is a named axis, in its units.

    Parameters
    ----------
    model : Model
    name : str
        As in `known` of `flexaxis.estimators.models.axes.MODELS`.
    identify : sequence of str
        Parameters, or inverses, whose values are where an estimate starts.
    """
    named = _axis(name)
    tables = ("states", "A", "B", "C", "reset")
    if any(getattr(model, table) != getattr(named, table) for table in tables):
        return False
    free = {parameter.removeprefix("1/") for parameter in identify}
    for parameter, value in named.nominal.items():
        ratio = model.nominal[parameter] / value
        if not (1 / STARTED <= ratio <= STARTED if parameter in free else abs(ratio - 1) <= SAME):
            return False
    return True


def moves_as(model: Model, name: str) -> bool:
    """
    Return whether a model has about the poles of a named axis, in whatever units.

    Parameters
    ----------
    model : Model
    name : str
        As for `is_axis`.
    """
    rates, reference = _rates(model), _rates(_axis(name))
    if len(rates) != len(reference) or not rates.all():
        return False
    return bool(np.abs(np.log(rates / reference)).max() <= np.log(NEAR))


def moving_poles(model: Model) -> NDArray[np.complex128]:
    """Return the poles [1/s] of the linear part of a model, but for those that do not move."""
    poles = _poles(replace(model, laws=()))
    return poles[np.abs(poles.real) > 1e-6 * np.abs(poles).max(initial=0.0)]


def named_values(name: str, identify: Sequence[str]) -> NDArray[np.float64]:
    """Return θ (p,) of a named axis [SI]; NaN for what it has not."""
    values = _axis(name).nominal
    return np.array(
        [
            values.get(n.removeprefix("1/"), np.nan) ** (-1.0 if n.startswith("1/") else 1.0)
            for n in identify
        ]
    )


def _axis(name: str) -> Model:
    return next(m.factory(m.known[name]) for m in MODELS.values() if name in m.known)


def _rates(model: Model) -> NDArray[np.float64]:
    """Return the sizes (n,) of the poles in order [1/s]."""
    return np.sort(np.abs(_poles(model)))


def _poles(model: Model) -> NDArray[np.complex128]:
    one = model.parametrize(model.parameters[:1])
    return np.linalg.eigvals(one.matrices(one.theta)[0]).astype(np.complex128)
