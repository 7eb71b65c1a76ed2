"""The twelve physical parameters of the axis, and named sets of them."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from numbers import Real
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from flexaxis.sim.errors import ParameterError, unknown

PARAMETER_UNITS = {
    "k_T": "1",
    "J_m": "kg m^2",
    "J_g": "kg m^2",
    "J_a": "kg m^2",
    "k_g": "N m/rad",
    "k_a": "N m/rad",
    "d_g": "N m s/rad",
    "d_a": "N m s/rad",
    "f_m": "N m s/rad",
    "f_g": "N m s/rad",
    "f_a": "N m s/rad",
    "r": "1",
}
"""Unit of each parameter, in the order that every array of parameters has."""

PARAMETER_NAMES = tuple(PARAMETER_UNITS)
"""The parameters in the order that every array of them has."""

DEFAULT_IDENTIFY = ("k_T", "1/J_a", "f_m")
"""What is estimated unless a scenario says otherwise: the paper's three."""

DATA_SHEET = {"poles": "1", "torque_limit": "N m", "noise": "unit of the output"}
"""What else can be told of an axis, with its unit: periods of cogging in a turn of the motor, the
largest command that acts, and the standard deviation of the measurement noise."""

MAY_BE_ZERO = frozenset({"d_g", "d_a", "f_m", "f_g", "f_a"})
"""Dampings and frictions; every other parameter must be positive."""


def parameter_problem(name: str, value: object) -> str | None:
    """Return what is wrong with a value of a parameter, or None if it is physical.

    Examples
    --------
    >>> parameter_problem("J_m", -1.0)
    'must be positive [kg m^2], not -1.0'
    >>> parameter_problem("f_m", 0.0)
    """
    unit = PARAMETER_UNITS[name]
    number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    if not math.isfinite(number):
        return f"must be a finite number [{unit}], not {value!r}"
    if name == "r" and not 0 < number <= 1:
        return f"must be in (0, 1], arm angle over motor angle (1/118, not 118), not {value!r}"
    if number < 0 or (number == 0 and name not in MAY_BE_ZERO):
        allowed = "zero or positive" if name in MAY_BE_ZERO else "positive"
        return f"must be {allowed} [{unit}], not {value!r}"
    return None


@dataclass(frozen=True, kw_only=True)
class AxisParameters:
    """Physical parameters of the three-mass axis, in SI units.

    Motor quantities are on the motor side, gear and arm quantities on the arm side.

    Attributes
    ----------
    k_T : float
        Torque constant: motor torque per unit of command [N m per N m].
    J_m, J_g, J_a : float
        Moments of inertia of motor, gear and arm [kg m^2].
    k_g, k_a : float
        Spring constants between motor and gear, and between gear and arm [N m/rad].
    d_g, d_a : float
        Damping coefficients of the same two couplings [N m s/rad].
    f_m, f_g, f_a : float
        Viscous friction of motor, gear and arm [N m s/rad].
    r : float
        Gear ratio: gear angle over motor angle, below one.

    Raises
    ------
    ParameterError
        If a value is not finite, or not positive where it must be.
    """

    k_T: float
    J_m: float
    J_g: float
    J_a: float
    k_g: float
    k_a: float
    d_g: float
    d_a: float
    f_m: float
    f_g: float
    f_a: float
    r: float

    def __post_init__(self) -> None:
        for name, value in self.as_dict().items():
            if problem := parameter_problem(name, value):
                raise ParameterError(f"{name} {problem}.")

    def as_dict(self) -> dict[str, float]:
        """Return the values by name."""
        return {name: getattr(self, name) for name in PARAMETER_NAMES}

    def as_array(self) -> NDArray[np.float64]:
        """Return the values (12,) in the order of `PARAMETER_NAMES`."""
        return np.array([getattr(self, name) for name in PARAMETER_NAMES], dtype=float)

    def replace(self, **changes: float) -> AxisParameters:
        """Return a copy with some values changed.

        Raises
        ------
        ParameterError
            If a name is unknown or a value is not physical.
        """
        for name in changes:
            if name not in PARAMETER_UNITS:
                raise ParameterError(unknown("parameter", name, PARAMETER_NAMES))
        return dataclasses.replace(self, **changes)


# E. Wernholt and S. Gunnarsson, "Nonlinear identification of a physically parameterized robot
# model", SYSID 2006: all inertia of the axis, and the parts of it that motor and gear have.
_WG_J, _WG_MOTOR, _WG_GEAR = 0.03291699877416, 0.17910964111956, 0.61206166914114

_OWN: dict[str, AxisParameters] = {
    # Constructed for this project, because Östring & Gunnarsson print no numbers: an axis of
    # the size of an industrial robot's first one, its two modes (100 and 151 rad/s) put where
    # their Figure 3 has its peaks, and such that every claim of their paper holds on it.
    "n1": AxisParameters(
        k_T=1.0,
        J_m=1.2e-3,
        J_g=7.0,
        J_a=0.8,
        k_g=1.06e5,
        k_a=8.4e3,
        d_g=26.0,
        d_a=1.6,
        f_m=0.05,
        f_g=0.5,
        f_a=0.1,
        r=1 / 118,
    ),
    # Constructed as a stress case: so lightly damped that the estimates adapt faster than the
    # plant forgets, where the theory of slow adaptation no longer holds.
    "n2": AxisParameters(
        k_T=1.0,
        J_m=2.1e-3,
        J_g=15.0,
        J_a=1.7,
        k_g=1.7e5,
        k_a=4.8e4,
        d_g=33.0,
        d_a=7.6,
        f_m=0.0085,
        f_g=3.0,
        f_a=1.1,
        r=1 / 118,
    ),
    # Published: axis one of a large industrial robot, all on the motor side. Its friction is most
    # of it dry, a law of its own: see models_mjcf/three_mass/wg.md.
    "wg": AxisParameters(
        k_T=1.0,
        J_m=_WG_MOTOR * _WG_J,
        J_g=_WG_GEAR * _WG_J,
        J_a=(1 - _WG_MOTOR - _WG_GEAR) * _WG_J,
        k_g=20.59269827430799,
        k_a=20.23072060978318,
        d_g=0.06241814047290,
        d_a=0.00987527995798,
        f_m=0.00986346744839,
        f_g=0.0,
        f_a=0.0,
        r=1.0,
    ),
}


@cache
def presets() -> Mapping[str, AxisParameters]:
    """Return the named parameter sets: those above, and the drives of models_mjcf/drives.toml."""
    text = files("flexaxis.models_mjcf").joinpath("drives.toml").read_text(encoding="utf-8")
    drives = {name: AxisParameters(**values) for name, values in tomllib.loads(text).items()}
    return MappingProxyType(_OWN | drives)


def preset(name: str) -> AxisParameters:
    """Return a named parameter set.

    Raises
    ------
    ParameterError
        If there is no such set.

    Examples
    --------
    >>> preset("n1").J_g
    7.0
    """
    if name not in presets():
        raise ParameterError(unknown("preset", name, presets()))
    return presets()[name]
