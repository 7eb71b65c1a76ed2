"""Turn the knob of an estimator: the one option that buys speed with noise."""

from __future__ import annotations

import inspect

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.building.specs import parse


def with_knob(name: str, factor: float) -> str | None:
    """Return an estimator with its knob turned: "rpem-forgetting[forgetting=0.99]".

    A forgetting factor λ is turned in 1−λ, any other knob as it is. An estimator of your own says
    which option is its knob in the attribute `knob` of its class; one without, or with options
    already, stays as it is. None where the knob cannot be turned so far.

    Examples
    --------
    >>> with_knob("rpem-forgetting", 2.0)
    'rpem-forgetting[forgetting=0.99]'
    """
    knob, value = knob_of(name)
    if knob is None:
        return name
    found = turned(knob, value, factor)
    return with_value(name, found) if found > 0 else None


def turned(knob: str, value: float, factor: float) -> float:
    """Return a knob turned by a factor: λ in 1−λ, any other as it is.

    Examples
    --------
    >>> round(turned("forgetting", 0.99, 2.0), 6), turned("walk", 0.5, 2.0)
    (0.98, 1.0)
    """
    return 1 - (1 - value) * factor if knob == "forgetting" else value * factor


def with_value(name: str, value: float) -> str:
    """Return an estimator with its knob at a value."""
    knob, _ = knob_of(name)
    return f"{name}[{knob}={value:.12g}]"


def numbers_of(name: str) -> dict[str, float]:
    """Return the options of an estimator whose defaults are numbers above 0."""
    if name in REGISTRY:
        options = dict(REGISTRY[name].options)
    else:
        found = inspect.signature(parse(name).make).parameters.values()
        options = {p.name: p.default for p in list(found)[2:]}
    plain = {k: v for k, v in options.items() if isinstance(v, int | float)}
    return {k: float(v) for k, v in plain.items() if not isinstance(v, bool) and v > 0}


def usual_value(name: str) -> float:
    """Return the knob of a registered estimator on its axis; 0 where there is none."""
    entry = REGISTRY[name]
    return float(entry.options[entry.knob]) if entry.knob else 0.0


def knob_of(name: str) -> tuple[str | None, float]:
    """Return the name of the option that is the knob, and its usual value.

    Raises
    ------
    EstimatorError
        If there is no such estimator, or what its class calls its knob is no number.
    """
    spec = parse(name)
    if spec.options:
        return None, 0.0
    if name in REGISTRY:
        return REGISTRY[name].knob, usual_value(name)
    knob = getattr(spec.make, "knob", None)
    if knob is None:
        return None, 0.0
    option = inspect.signature(spec.make).parameters.get(knob)
    if option is None or not isinstance(option.default, int | float):
        raise EstimatorError(f"{name}: its `knob` {knob!r} is no option with a number as default")
    return knob, float(option.default)
