"""Classification of model parameters as tracked, learnt once, known or absent."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.filters.design import above_zero
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parameter_meaning import structure
from flexaxis.estimators.offline.structure import Prior, structure_names

ABSENT = (
    ("kappa", "gap"),
    ("c_sin", "c_cos"),
    ("f_c", "f_s"),
    ("f_s",),
)
"""Parameter groups of torque laws; on many axes, all parameters of a group are zero."""
SEEN = 0.25  # largest ratio of the standard deviations of a learnt parameter after and before
# initialisation

AS_TOLD = (
    "the initialisation data hardly excite the parameter, so the parameter keeps its nominal value"
)
AS_ABSENT = (
    "the initialisation data hardly excite the parameter, so the parameter is assumed to be zero"
)


def names_of(option: str, names: object, allowed: Sequence[str]) -> tuple[str, ...]:
    """Return the parameter names in an option; raise EstimatorError if a name is not allowed."""
    if isinstance(names, str) or not isinstance(names, Sequence | np.ndarray):
        raise EstimatorError(
            f"the option {option} is {names!r}; give a list of names from {', '.join(allowed)}"
            + (", or 'auto' or 'none'" if option == "learn" else "")
        )
    for name in names:
        if name not in allowed:
            raise EstimatorError(
                f"the option {option} contains {name!r}, which is not an allowed parameter: "
                + did_you_mean(str(name), allowed)
            )
    return tuple(dict.fromkeys(names))


def is_left(model: Model, name: str, identify: Sequence[str]) -> bool:
    """Return whether a model contains the parameter ``name`` but the list ``identify`` does not."""
    physical = name.removeprefix("1/")
    return physical in model.parameters and physical not in {n.removeprefix("1/") for n in identify}


def learnt_of(model: Model, tracked: Sequence[str], learn: Sequence[str] | str) -> tuple[str, ...]:
    """Return the parameters to learn once; "auto" omits linear-model parameters that are 0."""
    names = structure_names(model, tracked)
    if learn == "auto":
        return tuple(n for n in names if n in model.law_parameters or model.nominal[n])
    if learn == "none":
        return ()
    return names_of("learn", learn, names)


def without(model: Model, absent: Sequence[str]) -> Model:
    """Set all ``absent`` parameters of a `real_axis` to zero; return any other model unchanged."""
    left_out = dict.fromkeys((n for n in absent if model.name == "real_axis"), 0.0)
    return replace(model, nominal=dict(model.nominal) | left_out)


def told_groups(
    model: Model, names: Sequence[str], learnt: Sequence[str], stated: Sequence[str]
) -> list[dict[str, float]]:
    """Return the parameter groups that are shrunk towards stated nominal values or towards zero."""
    linear = tuple(n for n in structure(model) if n in learnt)
    groups = [group for group in (linear, *ABSENT) if group and set(group) <= set(names)]
    return [{n: model.nominal[n] if n in stated else 0.0 for n in group} for group in groups]


def refuse_zero(thought: Prior) -> None:
    """Raise EstimatorError if the scale of a parameter is zero."""
    for name, scale in zip(thought.names, thought.scale, strict=True):
        if not scale:
            raise EstimatorError(
                f"the nominal value of {name} is 0, so the scale of {name} is unknown; give the "
                f"expected magnitude of {name} as its nominal value, or remove {name} from "
                "identify and track"
            )


def known_better(model: Model, thought: Prior, deviations: Mapping[str, float]) -> Prior:
    """Return the prior, with standard deviations replaced by those given in ``deviations``."""
    if not isinstance(deviations, Mapping):
        raise EstimatorError(
            f"the option deviations is {deviations!r}; give a mapping from parameter names to "
            "standard deviations"
        )
    known = [name.removeprefix("1/") for name in thought.names]
    for name in deviations:
        if name not in known and name not in model.parameters:
            raise EstimatorError(
                f"the option deviations contains {name!r}, which is not a parameter of the model: "
                + did_you_mean(str(name), known)
            )
    deviation = thought.deviation.copy()
    for i, name in enumerate(thought.names):
        physical = name.removeprefix("1/")
        if physical in deviations:
            sd = above_zero(f"deviations[{physical!r}]", deviations[physical], "it")
            deviation[i] = sd if name == physical else sd * thought.start[i] ** 2
    return replace(thought, deviation=deviation)


def seen(after: ArrayLike, before: ArrayLike) -> NDArray[np.bool_]:
    """
    For each parameter, return whether the excitation has made the estimate much more accurate.

    Parameters without sufficient excitation should not be estimated, because their estimates would
    only compensate for model errors.

    Parameters
    ----------
    after, before : (p,) array_like
        Parameter variances after and before the excitation, in the same unit.
    """
    return np.asarray(np.sqrt(np.divide(after, before)) < SEEN)
