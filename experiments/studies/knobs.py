"""Turn the knob of an estimator: the way through its options that buys speed with noise."""

from __future__ import annotations

import inspect
import json
from collections.abc import Mapping
from typing import Any

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.knob import Knob, make_knob
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.running.estimators import parse


def with_knob(name: str, factor: float) -> str | None:
    """Return an estimator with its knob turned: "rpem-forgetting[forgetting=0.99]".

    An estimator of your own says in the attribute `knob` of its class what is turned, and in what
    (`flexaxis.estimators.knob.make_knob`); one without, or with options already, stays as it is.
    None where the knob cannot be turned so far.

    Examples
    --------
    >>> with_knob("rpem-forgetting", 2.0)
    'rpem-forgetting[forgetting=0.99]'
    """
    knob = knob_of(name)
    if knob is None:
        return name
    found = knob.turned(factor)
    return None if found is None else setting(name, found)


def setting(name: str, options: Mapping[str, Any]) -> str:
    """Return an estimator with options, as for `--estimator`.

    Examples
    --------
    >>> setting("ekf", {"walk": 0.002})
    'ekf[walk=0.002]'
    >>> setting("mine.py:Mine", {"robust": True, "gain": 0.1})
    'mine.py:Mine[robust=true,gain=0.1]'
    """
    return f"{name}[{','.join(f'{key}={_written(value)}' for key, value in options.items())}]"


def _written(value: Any) -> str:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return f"{value:.12g}" if number else json.dumps(value)


def _defaults(name: str) -> dict[str, Any]:
    """Return the options of an estimator with their defaults."""
    if name in REGISTRY:
        return dict(REGISTRY[name].options)
    found = inspect.signature(parse(name).make).parameters.values()
    return {p.name: p.default for p in list(found)[2:]}


def knob_of(name: str) -> Knob | None:
    """Return the knob of an estimator, None where it has none, or options already.

    Raises
    ------
    EstimatorError
        If there is no such estimator, or its class declares what cannot be turned.
    """
    spec = parse(name)
    if spec.options:
        return None
    if name in REGISTRY:
        return REGISTRY[name].turning
    declared = getattr(spec.make, "knob", None)
    if declared is None:
        return None
    try:
        return make_knob(declared, _defaults(name))
    except EstimatorError as error:
        raise EstimatorError(f"{name}: {error}") from None
