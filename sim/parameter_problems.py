"""What is wrong with the parameters of a scenario: with its model, their set, names and values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from flexaxis.models_mjcf import DEFAULT, MODEL_NAMES
from flexaxis.sim.errors import did_you_mean, unknown
from flexaxis.sim.law_parameters import LAW_NAMES
from flexaxis.sim.parameters import MAY_BE_ZERO, parameter_names, parameter_problem, presets
from flexaxis.sim.tables.rate_problems import Problem, as_number

OF_THE_GEAR = ("backlash", "stiffening", "gear_friction", "load_friction")
"""Tables that act on the spring of the gear, or have a bound by a model that does."""


def _model(content: Mapping[str, Any]) -> str:
    """Return the model of a scenario: the usual one for a wrong one."""
    return name if (name := content.get("model")) in MODEL_NAMES else DEFAULT


def names_of(content: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the parameters of a scenario's plant."""
    return parameter_names(_model(content))


def parameter_problems(content: Mapping[str, Any]) -> Iterator[Problem]:
    """Yield what is wrong with model, preset and parameters, or is not of that model."""
    names, parameters = names_of(content), content.get("parameters")
    for key, allowed in (("model", MODEL_NAMES), ("preset", presets(_model(content)))):
        name = content.get(key)
        if isinstance(name, str) and name not in allowed:
            yield key, unknown(key, name, allowed)
    for table in OF_THE_GEAR if "k_g" not in names else ():
        if content.get(table) is not None:
            yield table, f"is of the spring of a gear, which the model {_model(content)} has not"
    for key, value in parameters.items() if isinstance(parameters, Mapping) else ():
        if key not in names:
            yield f"parameters.{key}", unknown("parameter", key, names)
        elif as_number(value) is not None and (problem := parameter_problem(key, value)):
            yield f"parameters.{key}", problem


def name_problems(names: list[tuple[str, str]], parameters: Sequence[str]) -> Iterator[Problem]:
    """Yield why names, each with its key, stand for none of the parameters, or for one again."""
    seen: dict[str, str] = {}
    for key, name in names:
        parameter = name.removeprefix("1/")
        if parameter not in parameters:
            known = [*parameters, *(f"1/{parameter}" for parameter in parameters)]
            yield (
                key,
                f"unknown parameter {name!r}; known are {', '.join(parameters)} and the "
                f"inverse of each, such as '1/J_m'; and of laws {', '.join(LAW_NAMES)}."
                f"{did_you_mean(name, [*known, *LAW_NAMES])}",
            )
        elif parameter in seen:
            yield key, f"{name!r} after {seen[parameter]!r}: name each once"
        seen.setdefault(parameter, name)


def zero_problems(names: list[tuple[str, str]], parameters: Any) -> Iterator[Problem]:
    """Yield why parameters cannot be estimated with the values that they are given."""
    given = parameters if isinstance(parameters, Mapping) else {}
    for key, name in names:
        parameter = name.removeprefix("1/")
        if parameter in MAY_BE_ZERO and as_number(given.get(parameter)) == 0:
            yield (
                key,
                f"{name!r} cannot be estimated where parameters.{parameter} is 0, for errors are "
                "in % of the nominal value: give it one above 0, or do not estimate it",
            )
