"""A grey-box model as the state space of python-control, which estimators do not need."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexaxis.estimators.errors import EstimatorError, did_you_mean

if TYPE_CHECKING:
    from control import StateSpace

    from flexaxis.estimators.models.model import Model


def to_statespace(model: "Model", values: Mapping[str, float]) -> "StateSpace":
    """Return a model at some values; `flexaxis.estimators.models.model.Model` explains."""
    try:
        from control import ss
    except ImportError as error:
        raise EstimatorError(
            "a control.StateSpace needs python-control, which is not installed: pip install control"
        ) from error
    for name in values:
        if name not in model.parameters:
            raise EstimatorError(
                f"model {model.name!r} has no parameter {name!r}: "
                + did_you_mean(name, model.parameters)
            )
    other = replace(model, nominal=dict(model.nominal) | dict(values))
    chosen = other.parametrize(other.parameters[:1])
    A, B, C = chosen.matrices(chosen.theta)
    return ss(
        A, B, C, np.zeros((1, 1)), inputs=["torque"], outputs=["speed"], states=list(model.states),
        name=model.name.replace(", ", "-"),
    )  # fmt: skip
