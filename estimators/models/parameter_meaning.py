"""
The meaning of model parameters, derived from their position in the model equations.

The functions in the module `parameter_meaning` do not use parameter names. For example, Coulomb
friction is the parameter with the role ``coulomb`` in a friction law. Springs and dampers are the
parameters that couple two states and are divided by an inertia.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axis_models import N1, three_mass
from flexaxis.estimators.models.laws import LAWS
from flexaxis.estimators.models.model import Model

LEVELS = ("coulomb", "breakaway", "motor", "external", "motor_slow", "external_slow")
"""Roles of the friction torques; a friction law has no effect if all its friction torques are 0."""
LEARNT = ("k_g", "J_m", "k_a", "d_g", "d_a")
"""Structural parameters of the three-mass axis, in the order in which `structure` sorts them."""


def shapes_of_friction(
    model: Model, names: Sequence[str]
) -> dict[tuple[str, ...], tuple[str, ...]]:
    """
    Return the shape parameters of each friction law, keyed by the friction torques of the law.

    The shape parameters of a law are all its parameters in ``names`` except the first friction
    torque.
    """
    shapes = {}
    for law in model.laws:
        levels = [law.own[role] for role in LEVELS if law.own.get(role) in names]
        shape = [n for n in law.names if n in names and n not in levels[:1]]
        if LAWS[law.kind].rubs and levels and shape:
            shapes[tuple(levels)] = tuple(shape)
    return shapes


def fixable(model: Model) -> tuple[str, ...]:
    """
    Return the parameters that are fixed if the initialisation data do not excite them.

    The returned parameters are the structural parameters and the parameters of backlash and
    nonlinear springs. Friction parameters are excluded because the filter tracks them. Cogging
    parameters are excluded because cogging affects the output at any speed.
    """
    laws = (n for law in model.laws for role, n in law.own.items() if law.roles[role].fixable)
    return (*structure(model), *laws)


def structure(model: Model) -> tuple[str, ...]:
    """
    Return the parameters of a linear model that are learnt only once.

    The returned parameters are those of springs and dampers, which act between states, and at most
    one inertia. The nominal values of springs, dampers and inertias are usually computed instead of
    measured, and the true values do not change in use. If the model contains springs or dampers,
    the inertia on which the input acts is included, because the vibration modes determine the
    ratios of all inertias. If the model contains neither springs nor dampers, the inertia is
    excluded, because the data do not determine the common scale of all torques.
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
Largest allowed ratio between corresponding poles of a model and of the nominal axis.

If the poles of a model and of the nominal axis differ by at most a factor of ``NEAR``, the model is
treated as the nominal axis. The allowed ratio is large enough for models whose parameters are half
or twice the true values. The test axis "n2" is not treated as the nominal axis "n1", because the
motor of "n2" coasts 11 times as long.
"""
STARTED = 4.0  # largest ratio between the initial estimate of a parameter and its nominal value
SAME = 1e-9  # relative tolerance for the values of all other parameters


def is_nominal_axis(model: Model, identify: Sequence[str]) -> bool:
    """
    Return whether a model agrees with the nominal axis in matrices, parameter values and units.

    Parameters
    ----------
    model : Model
    identify : sequence of str
        Names of identified parameters or inverse parameters. The nominal values of identified
        parameters are initial estimates and can therefore differ from the values of the nominal
        axis.
    """
    axis, free = three_mass(N1), {name.removeprefix("1/") for name in identify}
    if any(getattr(model, t) != getattr(axis, t) for t in ("states", "A", "B", "C", "reset")):
        return False
    for name, value in N1.items():
        most = STARTED if name in free else 1 + SAME
        if not 1 / most <= model.nominal[name] / value <= most:
            return False
    return True


def moves_as_nominal(model: Model) -> bool:
    """Return whether the poles of a model are about those of the nominal axis, in any units."""
    rates, reference = (np.sort(np.abs(_poles(m))) for m in (model, three_mass(N1)))
    if len(rates) != len(reference) or not rates.all():
        return False
    return bool(np.abs(np.log(rates / reference)).max() <= np.log(NEAR))


def moving_poles(model: Model) -> NDArray[np.complex128]:
    """Return the poles [1/s] of a model's linear part, except poles with a real part of zero."""
    poles = _poles(replace(model, laws=()))
    return poles[np.abs(poles.real) > 1e-6 * np.abs(poles).max(initial=0.0)]


def _poles(model: Model) -> NDArray[np.complex128]:
    one = model.parametrize(model.parameters[:1])
    return np.linalg.eigvals(one.matrices(one.theta)[0]).astype(np.complex128)
