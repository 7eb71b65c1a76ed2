"""Classification of the parameters of a model as tracked, learnt once, known or absent."""

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
"""Groups of law parameters; on many axes, all parameters of a group are zero."""
SEEN = 0.25  # largest ratio of the standard deviations of a learnt parameter after and before
# initialisation

AS_TOLD = "the initialisation data hardly excite this parameter, so it keeps its nominal value"
AS_ABSENT = "the initialisation data hardly excite this parameter, so it is assumed to be zero"


def names_of(option: str, names: object, allowed: Sequence[str]) -> tuple[str, ...]:
    """Return the names in an option; raise EstimatorError if a name is not allowed."""
    if isinstance(names, str) or not isinstance(names, Sequence | np.ndarray):
        raise EstimatorError(
            f"{option} is {names!r}; give a list of names from {', '.join(allowed)}"
            + (", or 'auto' or 'none'" if option == "learn" else "")
        )
    for name in names:
        if name not in allowed:
            raise EstimatorError(
                f"{option} names {name!r}, which is not among the allowed parameters: "
                + did_you_mean(str(name), allowed)
            )
    return tuple(dict.fromkeys(names))


def is_left(model: Model, name: str, identify: Sequence[str]) -> bool:
    """Return whether a model contains a parameter that is not identified, nor is its inverse."""
    physical = name.removeprefix("1/")
    return physical in model.parameters and physical not in {n.removeprefix("1/") for n in identify}


def learnt_of(model: Model, tracked: Sequence[str], learn: Sequence[str] | str) -> tuple[str, ...]:
    """Return the parameters to learn once; "auto" excludes linear parameters of value zero."""
    names = structure_names(model, tracked)
    if learn == "auto":
        return tuple(n for n in names if n in model.law_parameters or model.nominal[n])
    if learn == "none":
        return ()
    return names_of("learn", learn, names)


def without(model: Model, absent: Sequence[str]) -> Model:
    """Return a `real_axis` with all ``absent`` parameters set to zero, or any other model as is."""
    left_out = dict.fromkeys((n for n in absent if model.name == "real_axis"), 0.0)
    return replace(model, nominal=dict(model.nominal) | left_out)


def told_groups(
    model: Model, names: Sequence[str], learnt: Sequence[str], stated: Sequence[str]
) -> list[dict[str, float]]:
    """Return groups of parameters that are drawn to their nominal values if stated, or to zero."""
    linear = tuple(n for n in structure(model) if n in learnt)
    groups = [group for group in (linear, *ABSENT) if group and set(group) <= set(names)]
    return [{n: model.nominal[n] if n in stated else 0.0 for n in group} for group in groups]


def refuse_zero(thought: Prior) -> None:
    """Raise EstimatorError if a parameter has a scale of zero."""
    for name, scale in zip(thought.names, thought.scale, strict=True):
        if not scale:
            raise EstimatorError(
                f"the nominal value of {name} is 0, so the scale of its estimate is unknown; give "
                f"the expected size of {name}, or leave it out of identify and track"
            )


def known_better(model: Model, thought: Prior, deviations: Mapping[str, float]) -> Prior:
    """Return a prior with some standard deviations replaced by those given in ``deviations``."""
    if not isinstance(deviations, Mapping):
        raise EstimatorError(
            f"deviations is {deviations!r}; give a mapping from parameter to standard deviation"
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
            sd = above_zero(f"deviations[{physical!r}]", deviations[physical], "a number")
            deviation[i] = sd if name == physical else sd * thought.start[i] ** 2
    return replace(thought, deviation=deviation)


def seen(after: ArrayLike, before: ArrayLike) -> NDArray[np.bool_]:
    """
    Return, for each parameter, whether the excitation has made its estimate much more accurate.

    The other parameters should not be estimated, because their estimates would only compensate for
    errors of the model.

    Parameters
    ----------
    after, before : (p,) array_like
        Variances after and before the excitation, in the same unit.
    """
    return np.asarray(np.sqrt(np.divide(after, before)) < SEEN)
