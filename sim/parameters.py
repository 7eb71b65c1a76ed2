"""Define the names, units and nominal values of all linear and nonlinear plant parameters."""

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
    """Read the names and nominal values of a model's parameters from its MJCF file.

    The torque constant ``k_T`` is the attribute `gear` of the motor actuator in the MJCF file. Each
    body has an inertia such as ``J_m`` and a friction coefficient such as ``f_m``. Each tendon has
    a stiffness such as ``k_g`` and a damping coefficient such as ``d_g``. The subscript of a
    parameter is the first letter of the name of its body or tendon. If the model has only one
    tendon, the tendon parameters have no subscript. The gear ratio ``r`` is the coefficient of the
    motor joint in the first tendon. If the gear ratio of a model is 1, the model has no parameter
    ``r``.

    The MJCF file must describe a chain of bodies called motor, gear, arm or load, with a tendon
    between each pair of adjacent bodies. The names of any two tendons must start with different
    letters.
    """
    root = ElementTree.fromstring(model_files(model)[0])
    bodies, tendons = [*root.iter("body")], root.findall("tendon/fixed")

    def number(owner: ElementTree.Element, path: str, key: str) -> float:
        element = owner.find(path)
        if element is None or not (text := element.get(key)):
            raise ParameterError(
                f"model {model}: {owner.get('name')} has no {key} in the MJCF file."
            )
        # the third inertia is the inertia about the z axis
        return float(text.split()[2 * (key == "diaginertia")])

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
    """Return the names of a model's parameters, in the order of the columns in parameter arrays."""
    return tuple(nominal_numbers(model))


def model_with(names: Iterable[str]) -> str | None:
    """Return the first model with exactly the parameters `names`, or None if no model has them."""
    unordered = set(names)
    return next((model for model in MODEL_NAMES if set(parameter_names(model)) == unordered), None)


PARAMETER_NAMES = parameter_names()
"""Names of the parameters of the three-mass axis."""

PARAMETER_UNITS = {
    name: _UNITS.get(name, _UNITS[name[0]])
    for model in MODEL_NAMES
    for name in parameter_names(model)
}
"""Units of all model parameters, keyed by parameter; three-mass parameters come first."""

DEFAULT_IDENTIFY = ("k_T", "1/J_a", "f_m")
"""Names of the parameters that are estimated by default and in Östring and Gunnarsson's paper."""

DATA_SHEET = {
    "poles": "1",
    "torque_limit": "N m",
    "noise": "unit of the output",
    "gear_friction": "1",
}
"""Units of data-sheet values that are not plant parameters, keyed by name.

The value of `poles` is the number of cogging periods per motor revolution, `torque_limit` is the
torque limit of the drive, and `noise` is the standard deviation of the measurement noise. The value
of `gear_friction` is 1 if the motor friction increases with the gear load.
"""

MAY_BE_ZERO = frozenset(name for name in PARAMETER_UNITS if name[0] in "df")
"""Names of the damping and friction coefficients, the only linear parameters that can be 0."""


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
"""Units of the nonlinear parameters (friction, backlash and stiffening spring), keyed by name.

The parameter f_c is the Coulomb friction, and f_s is the breakaway torque minus the Coulomb
friction. The parameter v_s is the Stribeck speed. The bristles of LuGre friction have the stiffness
sigma_0 and the damping sigma_1. The parameters alpha and beta are inverse speeds that define the
static friction curve. The parameter kappa is the ratio of cubic to linear stiffness of the gear
spring. The parameter ``gap`` is the width of the backlash gap on the arm side. In the parameter
array of a record, the last columns contain the nonlinear parameters.
"""

LAW_NAMES = tuple(LAW_UNITS)
"""Names of all nonlinear parameters, in the order of their columns in parameter arrays."""

LAW_MAY_BE_ZERO = frozenset({"f_c", "f_s"})
"""Names of the friction parameters that a fault can set to zero."""

ESTIMATED_ONLY = ("c_sin", "c_cos")
"""Names of the cogging parameters, which estimators use but records do not contain."""

LAW_PARAMETERS: Mapping[str, tuple[str, ...]] = {
    "friction": ("f_c",),
    "lugre": ("f_c", "f_s", "v_s", "sigma_0", "sigma_1"),
    "static_friction": ("f_c", "f_s", "alpha", "beta"),
    "load_friction": ("f_c",),
    "gear_friction": ("f_c", "f_s", "v_s"),
    "backlash": ("gap",),
    "stiffening": ("kappa",),
}
"""Names of the nonlinear parameters that each scenario table defines, keyed by table name.

The attribute `law` of a scenario table contains the parameter values of the table. If several
tables of a scenario define a parameter with the same name, the first table determines its value.
"""

FIXED = {"gap": "backlash", "kappa": "stiffening"}
"""Scenario tables of the nonlinear parameters that cannot change in a run, keyed by parameter."""


def parameter_problem(name: str, value: float) -> str | None:
    """Return an error message if a parameter value is physically impossible; otherwise return None.

    Examples
    --------
    >>> parameter_problem("J_m", -1.0)
    'must be positive [kg m^2], not -1.0'
    >>> parameter_problem("f_m", 0.0)
    """
    unit = PARAMETER_UNITS[name]
    if not math.isfinite(value):
        return f"the parameter must be a finite number [{unit}], not {value!r}"
    if name == "r" and not 0 < value <= 1:
        return f"the gear ratio (gear angle over motor angle) must be in (0, 1], not {value!r}"
    if value < 0 or (value == 0 and name not in MAY_BE_ZERO):
        allowed = "zero or positive" if name in MAY_BE_ZERO else "positive"
        return f"must be {allowed} [{unit}], not {value!r}"
    return None


class AxisParameters(Frozen):
    """Physical parameters of an axis in SI units, accessible as items and as attributes.

    The motor parameters refer to the motor side of the gear, and the parameters of the other masses
    refer to the arm side.

    Parameters
    ----------
    values : mapping of str to float
        Values of all parameters of a model, keyed by parameter name, in any order. The torque
        constant is k_T, the moments of inertia are J, and the gear ratio (gear angle over motor
        angle) is r. The spring constants of the couplings are k, and their damping coefficients are
        d. The viscous friction coefficients of the bodies are f. The function `nominal_numbers`
        explains the parameter names.
    **more : float
        Parameter values as keyword arguments, which override those in the argument `values`.

    Raises
    ------
    ParameterError
        If the names are not exactly the parameters of a model, or if a value is physically
        impossible.
    """

    __slots__ = ()

    def __init__(self, values: Mapping[str, float] = Frozen(), /, **more: float) -> None:
        named = {**values, **more}
        if (model := model_with(named)) is None:
            raise ParameterError(
                f"no model has exactly the parameters {', '.join(named)}; the model {DEFAULT} has "
                f"{', '.join(PARAMETER_NAMES)}."
            )
        super().__init__({name: named[name] for name in parameter_names(model)})
        for name, value in self.items():
            if problem := parameter_problem(name, value):
                raise ParameterError(f"{name}: {problem}.")

    def __getattr__(self, name: str) -> float:
        if name in self:
            return self[name]
        raise AttributeError(name)

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(tuple(self.items()))

    def as_dict(self) -> dict[str, float]:
        """Return the parameters as an ordinary dictionary, keyed by name."""
        return dict(self)

    def replace(self, **changes: float) -> AxisParameters:
        """Return a copy of the parameters with some values changed.

        Raises
        ------
        ParameterError
            If a parameter name is unknown, or if a value is physically impossible.
        """
        for name in changes:
            if name not in self:
                raise ParameterError(unknown("parameter", name, self))
        return AxisParameters(self, **changes)


@cache
def presets(model: str = DEFAULT) -> Mapping[str, Mapping[str, float]]:
    """Return the named parameter sets (presets) of a model, keyed by name.

    The preset "n1" contains the parameter values in the MJCF file. Each table of each TOML file in
    the model's folder defines another preset.
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
        If the model has no preset with the name `name`.

    Examples
    --------
    >>> preset("n1").J_g
    7.0
    """
    if name not in presets(model):
        raise ParameterError(unknown("preset", name, presets(model)))
    return AxisParameters(presets(model)[name])


def meant(parameter: str) -> str:
    """Return the standard name of a fault parameter; the name ``coulomb`` is an alias for f_c.

    Examples
    --------
    >>> meant("coulomb"), meant("f_m")
    ('f_c', 'f_m')
    """
    return "f_c" if parameter == "coulomb" else parameter
