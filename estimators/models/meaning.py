"""
The meaning of the parameters of a model, from their places rather than from their names.

Coulomb friction is the parameter of a law in that role. Springs and dampers couple states and are
divided by an inertia.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axes import N1, three_mass
from flexaxis.estimators.models.laws import LAWS
from flexaxis.estimators.models.model import Model

LEVELS = ("coulomb", "breakaway", "motor", "external", "motor_slow", "external_slow")
"""Roles of a friction law that has no effect if all of them are zero."""
LEARNT = ("k_g", "J_m", "k_a", "d_g", "d_a")
"""The structure of the three-mass axis, in the order of estimates; that of others follows it."""


def shapes_of_friction(
    model: Model, names: Sequence[str]
) -> dict[tuple[str, ...], tuple[str, ...]]:
    """Return the levels of each friction law among names, and its parameters of shape."""
    shapes = {}
    for law in model.laws:
        levels = [law.own[role] for role in LEVELS if law.own.get(role) in names]
        shape = [n for n in law.names if n in names and n not in levels[:1]]
        if LAWS[law.kind].rubs and levels and shape:
            shapes[tuple(levels)] = tuple(shape)
    return shapes


def fixable(model: Model) -> tuple[str, ...]:
    """
    Return parameters that are fixed if the initialisation does not excite them.

    These are the structure, backlash and nonlinear springs. Friction is tracked, and cogging shows
    at any speed.
    """
    laws = (n for law in model.laws for role, n in law.own.items() if law.roles[role].fixable)
    return (*structure(model), *laws)


def structure(model: Model) -> tuple[str, ...]:
    """
    Return the parameters of a linear model that are learnt once: springs, dampers and one inertia.

    They are computed rather than measured, and do not change in use. Springs and dampers act
    between states. If there are any, so is the inertia on which the input acts: the modes weigh it
    against the others. A single inertia leaves the scale of all torques open.
    """
    n, terms = len(model.states), list(replace(model, laws=()).monomials())
    springs, inertias = [], []
    for name in model.parameters:
        places = [(i, j, powers) for i, j, (_, powers) in terms if name in powers]
        power = {powers[name] for *_, powers in places}
        if power == {-1} and any(j == n for _, j, _ in places):
            inertias.append(name)
        forces = all(j < n and min(powers.values()) < 0 for _, j, powers in places)
        if power == {1} and forces and any(i != j for i, j, _ in places):
            springs.append(name)
    names = [name for name in (*inertias, *springs) if springs and name not in model.fixed]
    return tuple(sorted(names, key=lambda name: [*LEARNT, name].index(name)))


NEAR = 2.5
"""
Factor within which the poles of a model agree with those of a named axis.

A start at half or twice the truth is still that axis. The motor of the stress case "n2" coasts 11
times as long as that of "n1".
"""
STARTED = 4.0  # largest factor between the start of an identified parameter and its nominal value
SAME = 1e-9  # relative tolerance of all other values


def is_axis(model: Model, name: str, identify: Sequence[str]) -> bool:
    """
    Return whether a model is a named axis, in its units.

    Parameters
    ----------
    model : Model
    name : str
        ``"n1"``.
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
    rates, reference = (np.sort(np.abs(_poles(m))) for m in (model, _axis(name)))
    if len(rates) != len(reference) or not rates.all():
        return False
    return bool(np.abs(np.log(rates / reference)).max() <= np.log(NEAR))


def moving_poles(model: Model) -> NDArray[np.complex128]:
    """Return the poles [1/s] of the linear part of a model, without those at zero."""
    poles = _poles(replace(model, laws=()))
    return poles[np.abs(poles.real) > 1e-6 * np.abs(poles).max(initial=0.0)]


def named_values(name: str, identify: Sequence[str]) -> NDArray[np.float64]:
    """Return θ (p,) of a named axis [SI]; NaN for parameters that it lacks."""
    values = _axis(name).nominal
    return np.array(
        [
            values.get(n.removeprefix("1/"), np.nan) ** (-1.0 if n.startswith("1/") else 1.0)
            for n in identify
        ]
    )


def _axis(name: str) -> Model:
    """Return a named axis: the nominal one of the benchmark is the only one."""
    return {"n1": three_mass(N1)}[name]


def _poles(model: Model) -> NDArray[np.complex128]:
    one = model.parametrize(model.parameters[:1])
    return np.linalg.eigvals(one.matrices(one.theta)[0]).astype(np.complex128)
