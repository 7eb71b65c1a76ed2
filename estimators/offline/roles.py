"""Selection of the parameters that are tracked, learnt once, known, or left out of a model."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.filters.design import above_zero
from flexaxis.estimators.models.meaning import structure
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.structure import Prior, structure_names

ABSENT = (
    ("kappa", "gap"),
    ("c_sin", "c_cos"),
    ("f_c", "f_s"),
    ("f_s",),
)
"""Groups of laws' parameters that are zero, all together, on many axes."""
SEEN = 0.25  # largest ratio of the standard deviations after and before the first seconds for which
# a parameter is learnt

AS_TOLD = "the first seconds hardly excite this parameter, so its value stays as it was told"
AS_ABSENT = "the first seconds hardly excite this parameter, so it is taken as absent"


def names_of(option: str, names: object, allowed: Sequence[str]) -> tuple[str, ...]:
    """Return the names in an option; raise EstimatorError if a name is not allowed."""
    if isinstance(names, str) or not isinstance(names, Sequence | np.ndarray):
        raise EstimatorError(
            f"{option} is {names!r}; give names among {', '.join(allowed)}"
            + ("; or 'auto' or 'none'" if option == "learn" else "")
        )
    for name in names:
        if name not in allowed:
            raise EstimatorError(
                f"{option} names {name!r}, which is not among the allowed parameters: "
                + did_you_mean(str(name), allowed)
            )
    return tuple(dict.fromkeys(names))


def is_left(model: Model, name: str, identify: Sequence[str]) -> bool:
    """Return whether a model contains a parameter and neither it nor its inverse is identified."""
    physical = name.removeprefix("1/")
    return physical in model.parameters and physical not in {n.removeprefix("1/") for n in identify}


def learnt_of(model: Model, tracked: Sequence[str], learn: Sequence[str] | str) -> tuple[str, ...]:
    """Return the parameters to learn once; "auto" omits linear parameters with the value zero."""
    names = structure_names(model, tracked)
    if learn == "auto":
        return tuple(n for n in names if n in model.law_parameters or model.nominal[n])
    if learn == "none":
        return ()
    return names_of("learn", learn, names)


def without(model: Model, absent: Sequence[str]) -> Model:
    """Return the model with all ``absent`` parameters set to zero, if it is the `real_axis`."""
    left_out = dict.fromkeys((n for n in absent if model.name == "real_axis"), 0.0)
    return replace(model, nominal=dict(model.nominal) | left_out)


def told_groups(
    model: Model, names: Sequence[str], learnt: Sequence[str], stated: Sequence[str]
) -> list[dict[str, float]]:
    """Return the values to which groups of parameters are drawn: nominal if stated, or zero."""
    linear = tuple(n for n in structure(model) if n in learnt)
    groups = [group for group in (linear, *ABSENT) if group and set(group) <= set(names)]
    return [{n: model.nominal[n] if n in stated else 0.0 for n in group} for group in groups]


def refuse_zero(thought: Prior) -> None:
    """Raise EstimatorError if a parameter has a scale of zero."""
    for name, scale in zip(thought.names, thought.scale, strict=True):
        if not scale:
            raise EstimatorError(
                f"{name} is told to be 0, so the scale of its estimate is unknown; give the size "
                f"expected of {name}, or leave it out of identify and track"
            )


def known_better(model: Model, thought: Prior, deviations: Mapping[str, float]) -> Prior:
    """Return a prior with some standard deviations replaced by those given in ``deviations``."""
    if not isinstance(deviations, Mapping):
        raise EstimatorError(
            f"deviations is {deviations!r}; give standard deviations by the names of parameters"
        )
    known = [name.removeprefix("1/") for name in thought.names]
    for name in deviations:
        if name not in known and name not in model.parameters:
            raise EstimatorError(
                f"deviations names {name!r}, which is not a parameter of this model: "
                + did_you_mean(str(name), known)
            )
    deviation = thought.deviation.copy()
    for i, name in enumerate(thought.names):
        physical = name.removeprefix("1/")
        if physical in deviations:
            sd = above_zero(f"deviations[{physical!r}]", deviations[physical], "its deviation")
            deviation[i] = sd if name == physical else sd * thought.start[i] ** 2
    return replace(thought, deviation=deviation)


def seen(after: ArrayLike, before: ArrayLike) -> NDArray[np.bool_]:
    """
    Return, for each parameter, whether the excitation has made its estimate much more accurate.

    Estimates of the other parameters would only compensate for errors of the model.

    Parameters
    ----------
    after, before : (p,) array_like
        Variances after and before the excitation, in the same unit.
    """
    return np.asarray(np.sqrt(np.divide(after, before)) < SEEN)
