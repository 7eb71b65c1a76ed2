"""Parameters of what a plant has beyond the linear model: names, units, and whose they are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

LAW_UNITS = MappingProxyType(
    {
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
)
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

The table says their values (`law`). Where two have a parameter of the same name, it is the first's.
"""

FIXED = ("backlash", "stiffening")
"""Tables whose parameters cannot change in the course of a run."""

COULOMB = "coulomb"
"""Another name of f_c in a fault or nuisance."""


def meant(parameter: str) -> str:
    """Return the parameter that a fault means.

    Examples
    --------
    >>> meant("coulomb"), meant("f_m")
    ('f_c', 'f_m')
    """
    return "f_c" if parameter == COULOMB else parameter


def law_owners(tables: Mapping[str, Any]) -> dict[str, str]:
    """Return, for each parameter of the laws of a plant, the key of the table it is of.

    Parameters
    ----------
    tables : mapping
        Of a scenario, by key; what is None is off.

    Examples
    --------
    >>> law_owners({"friction": {"coulomb": 0.1}, "lugre": None})
    {'f_c': 'friction'}
    """
    owners: dict[str, str] = {}
    for key, names in LAW_PARAMETERS.items():
        if tables.get(key) is not None:
            owners = dict.fromkeys(names, key) | owners
    return {name: owners[name] for name in LAW_NAMES if name in owners}


def law_values(tables: Iterable[Any]) -> dict[str, float]:
    """Return the parameters of laws, in the order of their columns.

    Parameters
    ----------
    tables : iterable
        Of a scenario, in the order of its keys; those that are laws have `law`.
    """
    values: dict[str, float] = {}
    for table in tables:
        values = getattr(table, "law", {}) | values
    return {name: float(values[name]) for name in LAW_NAMES if name in values}
