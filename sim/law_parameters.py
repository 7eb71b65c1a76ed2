"""Parameters of what a plant has beyond the linear model: names, units, and whose they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
"""Unit of each parameter of a law, in the order of their columns after the twelve of the axis.

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

LAWS: Mapping[str, Mapping[str, Callable[[Mapping[str, Any]], float]]] = {
    "friction": {"f_c": lambda table: table["coulomb"]},
    "lugre": {
        "f_c": lambda table: table["coulomb"],
        "f_s": lambda table: table["static"] - table["coulomb"],
        "v_s": lambda table: table["stribeck"],
        "sigma_0": lambda table: table["stiffness"],
        "sigma_1": lambda table: table["damping"],
    },
    "static_friction": {
        "f_c": lambda table: table["f_c"],
        "f_s": lambda table: table["f_s"],
        "alpha": lambda table: table["alpha"],
        "beta": lambda table: table["beta"],
    },
    "directional_friction": {"f_c": lambda table: table["f_c"]},
    "position_friction": {"f_c": lambda table: table["f_c"]},
    "load_friction": {"f_c": lambda table: table["f_c"]},
    "stiffening": {"kappa": lambda table: table["gear"]},
    "backlash": {"gap": lambda table: table["gear"]},
}
"""The parameters of each table of a scenario that is a law: how to read them from it.

Where two tables have one of the same name, it is that of the first.
"""

SETTABLE = tuple(
    (table, name)
    for table, names in LAWS.items()
    if table not in ("stiffening", "backlash")
    for name in names
)
"""What the engine can change in the course of a run: table and parameter."""

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
    for key, names in LAWS.items():
        if tables.get(key) is not None:
            owners = dict.fromkeys(names, key) | owners
    return {name: owners[name] for name in LAW_NAMES if name in owners}


def law_values(tables: Mapping[str, Any]) -> dict[str, float]:
    """Return the parameters of the laws of a plant, in the order of their columns.

    Parameters
    ----------
    tables : mapping
        As for `law_owners`, checked.
    """
    owners = law_owners(tables)
    return {name: float(LAWS[key][name](tables[key])) for name, key in owners.items()}
