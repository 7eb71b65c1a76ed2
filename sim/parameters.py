"""The parameters of an axis, as its MJCF names them, named sets of them, and those of its laws."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from types import MappingProxyType
from xml.etree import ElementTree

from flexaxis.models_mjcf import DEFAULT, MODEL_NAMES, model_files
from flexaxis.sim.errors import ParameterError, unknown
from flexaxis.sim.tables.config import Frozen

_UNITS = {
    "k_T": "1", "J": "kg m^2", "k": "N m/rad", "d": "N m s/rad", "f": "N m s/rad", "r": "1",
}  # fmt: skip


@cache
def nominal_numbers(model: str) -> Mapping[str, float]:
    """Return the parameters of a plant with the values of its MJCF, in order.

    They are the torque constant ``k_T`` (`gear` of the motor); of each body, with its initial,
    inertia ``J_m`` and friction ``f_m``; of each tendon stiffness ``k_g`` and damping ``d_g``,
    without an initial where there is one alone; and the gear ratio ``r``, the coefficient of the
    motor in the first tendon, unless that is 1.

    The MJCF is a chain of bodies called motor, gear, arm or load, with a tendon from each to the
    next; no two tendons have the same initial.
    """
    root = ElementTree.fromstring(model_files(model)[0])
    bodies, tendons = [*root.iter("body")], root.findall("tendon/fixed")

    def number(owner: ElementTree.Element, path: str, key: str) -> float:
        element = owner.find(path)
        if element is None or not (text := element.get(key)):
            raise ParameterError(f"model {model}: {owner.get('name')} in its MJCF has no {key}.")
        return float(text.split()[2 * (key == "diaginertia")])  # the third is about the axis z

    values = {"k_T": number(root, "actuator/motor", "gear")}
    for kind, owners, path, key in (
        ("J", bodies, "inertial", "diaginertia"),
        ("k", tendons, ".", "stiffness"),
        ("d", tendons, ".", "damping"),
        ("f", bodies, "joint", "damping"),
    ):
        for owner in owners:
            alone = owners is tendons and len(tendons) == 1
            initial = owner.get("name", "?")[0]
            values[kind if alone else f"{kind}_{initial}"] = number(owner, path, key)
    r = number(tendons[0], "joint", "coef")
    return MappingProxyType(values if r == 1 else values | {"r": r})


def parameter_names(model: str = DEFAULT) -> tuple[str, ...]:
    """Return the parameters of a plant in the order that every array of them has."""
    return tuple(nominal_numbers(model))


def model_with(names: Iterable[str]) -> str | None:
    """Return the first model with just these parameters, in any order, or None."""
    unordered = set(names)
    return next((model for model in MODEL_NAMES if set(parameter_names(model)) == unordered), None)


PARAMETER_NAMES = parameter_names()
"""Those of the paper's axis."""

PARAMETER_UNITS = {
    name: _UNITS.get(name, _UNITS[name[0]])
    for model in MODEL_NAMES
    for name in parameter_names(model)
}
"""Unit of each parameter that a model has, those of the paper's axis first."""

DEFAULT_IDENTIFY = ("k_T", "1/J_a", "f_m")
"""What is estimated unless a scenario says otherwise: the paper's three."""

DATA_SHEET = {"poles": "1", "torque_limit": "N m", "noise": "unit of the output"}
"""What else can be told of an axis, with its unit: periods of cogging in a turn of the motor, the
largest command that acts, and the standard deviation of the measurement noise."""

MAY_BE_ZERO = frozenset(name for name in PARAMETER_UNITS if name[0] in "df")
"""Dampings and frictions; every other parameter must be positive."""


LAW_UNITS = {
    "f_c": "N m",
    "f_s": "N m",
    "v_s": "rad/s",
    "sigma_0": "N m/rad",
    "sigma_1": "N m s/rad",
    "alpha": "s/rad",
    "beta": "s/rad",
    "kappa": "1/rad^2",
    "gap": "rad",
}
"""Unit of each parameter of a law, in the order of their columns after those of the axis.

They are the level of Coulomb friction and what it takes more to break away, the Stribeck speed,
stiffness and damping of the bristles, the two rates of a static curve, the cubic over the linear
coefficient of the gear spring, and the width of its gap on the arm side.
"""

LAW_NAMES = tuple(LAW_UNITS)
"""The parameters of laws in the order of their columns."""

LAW_MAY_BE_ZERO = frozenset({"f_c", "f_s"})
"""What may vanish in the course of a run."""

ESTIMATED_ONLY = ("c_sin", "c_cos")
"""What an estimator may call a parameter though no record has it: the phase of cogging is free."""

LAW_PARAMETERS: Mapping[str, tuple[str, ...]] = {
    "friction": ("f_c",),
    "lugre": ("f_c", "f_s", "v_s", "sigma_0", "sigma_1"),
    "static_friction": ("f_c", "f_s", "alpha", "beta"),
    "load_friction": ("f_c",),
    "gear_friction": ("f_c", "f_s", "v_s"),
    "backlash": ("gap",),
    "stiffening": ("kappa",),
}
"""The parameters of each table of a scenario that is a law, in the order of its keys.

The table knows their values (`law`). Where two have a parameter of one name, the first owns it.
"""

FIXED = {"gap": "backlash", "kappa": "stiffening"}
"""Parameters that cannot change in the course of a run, and the tables that they are of."""


def parameter_problem(name: str, value: float) -> str | None:
    """Return why a value of a parameter is not physical, or None if it is.

    Examples
    --------
    >>> parameter_problem("J_m", -1.0)
    'must be positive [kg m^2], not -1.0'
    >>> parameter_problem("f_m", 0.0)
    """
    unit = PARAMETER_UNITS[name]
    if not math.isfinite(value):
        return f"must be a finite number [{unit}], not {value!r}"
    if name == "r" and not 0 < value <= 1:
        return f"must be in (0, 1], arm angle over motor angle (1/118, not 118), not {value!r}"
    if value < 0 or (value == 0 and name not in MAY_BE_ZERO):
        allowed = "zero or positive" if name in MAY_BE_ZERO else "positive"
        return f"must be {allowed} [{unit}], not {value!r}"
    return None


class AxisParameters(Frozen):
    """Physical parameters of an axis by name, in SI units; each is an attribute as well.

    Motor quantities are on the motor side, those of the other masses on the arm side.

    Parameters
    ----------
    values : mapping of str to float
    **more : float
        All parameters of one of the models, in any order: torque constant k_T, moments of inertia
        J, spring constants k and damping coefficients d of the couplings, viscous frictions f, and
        the gear ratio r, gear angle over motor angle; see `nominal_numbers`.

    Raises
    ------
    ParameterError
        If a name lacks or is none of the model's, or a value is not finite, or not positive where
        it must be.
    """

    __slots__ = ()

    def __init__(self, values: Mapping[str, float] = Frozen(), /, **more: float) -> None:
        named = {**values, **more}
        if (model := model_with(named)) is None:
            raise ParameterError(
                f"no model has just the parameters {', '.join(named)}; {DEFAULT} has "
                f"{', '.join(PARAMETER_NAMES)}."
            )
        super().__init__({name: named[name] for name in parameter_names(model)})
        for name, value in self.items():
            if problem := parameter_problem(name, value):
                raise ParameterError(f"{name} {problem}.")

    def __getattr__(self, name: str) -> float:
        if name in self:
            return self[name]
        raise AttributeError(name)

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(tuple(self.items()))

    def as_dict(self) -> dict[str, float]:
        """Return the values by name."""
        return dict(self)

    def replace(self, **changes: float) -> AxisParameters:
        """Return a copy with some values changed.

        Raises
        ------
        ParameterError
            If a name is unknown or a value is not physical.
        """
        for name in changes:
            if name not in self:
                raise ParameterError(unknown("parameter", name, self))
        return AxisParameters(self, **changes)


@cache
def presets(model: str = DEFAULT) -> Mapping[str, Mapping[str, float]]:
    """Return the named parameter sets of a model.

    "n1" holds the values of the MJCF; other sets are tables of the TOML files in its folder.
    """
    texts = [text for name, text in sorted(model_files(model)[1].items()) if name.endswith(".toml")]
    tables = [tomllib.loads(text.decode()) for text in texts]
    named = {name: values for table in tables for name, values in table.items()}
    return MappingProxyType({"n1": nominal_numbers(model)} | named)


def preset(name: str, model: str = DEFAULT) -> AxisParameters:
    """Return a named parameter set of a model.

    Raises
    ------
    ParameterError
        If there is no such set, or it is none of this model.

    Examples
    --------
    >>> preset("n1").J_g
    7.0
    """
    if name not in presets(model):
        raise ParameterError(unknown("preset", name, presets(model)))
    return AxisParameters(presets(model)[name])


def meant(parameter: str) -> str:
    """Return the parameter that a fault means: its ``coulomb`` is f_c.

    Examples
    --------
    >>> meant("coulomb"), meant("f_m")
    ('f_c', 'f_m')
    """
    return "f_c" if parameter == "coulomb" else parameter
