"""What of a model is tracked, learnt once, told, or left out, from names that a user gives."""

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
"""What of the laws is zero on many an axis, in the groups in which it is."""
SEEN = 0.25  # standard deviation after the first seconds over that before, below which it is learnt

AS_TOLD = "the first seconds hardly move what it acts on, so it stays as it was told"
AS_ABSENT = "the first seconds hardly move what it acts on, so it is taken as absent"


def names_of(option: str, names: object, allowed: Sequence[str]) -> tuple[str, ...]:
    """Return names that an option gives, refused where there is no such parameter."""
    if isinstance(names, str) or not isinstance(names, Sequence | np.ndarray):
        raise EstimatorError(
            f"{option} is {names!r}; give names among {', '.join(allowed)}"
            + ("; or 'auto' or 'none'" if option == "learn" else "")
        )
    for name in names:
        if name not in allowed:
            raise EstimatorError(
                f"{option} names {name!r}, which is no parameter for that: "
                + did_you_mean(str(name), allowed)
            )
    return tuple(dict.fromkeys(names))


def is_left(model: Model, name: str, identify: Sequence[str]) -> bool:
    """Whether a model has a parameter that is not identified already, itself or inverted."""
    physical = name.removeprefix("1/")
    return physical in model.parameters and physical not in {n.removeprefix("1/") for n in identify}


def learnt_of(model: Model, tracked: Sequence[str], learn: Sequence[str] | str) -> tuple[str, ...]:
    """Return what is learnt once; of "auto" all but what is zero, which gives it no size."""
    names = structure_names(model, tracked)
    if learn == "auto":
        return tuple(n for n in names if n in model.law_parameters or model.nominal[n])
    if learn == "none":
        return ()
    return names_of("learn", learn, names)


def without(model: Model, absent: Sequence[str]) -> Model:
    """Return a model of the suite without what is neither told nor learnt."""
    left_out = dict.fromkeys((n for n in absent if model.name == "real_axis"), 0.0)
    return replace(model, nominal=dict(model.nominal) | left_out)


def told_groups(
    model: Model, names: Sequence[str], learnt: Sequence[str], stated: Sequence[str]
) -> list[dict[str, float]]:
    """Return to what groups of parameters are drawn: as stated, and zero where nothing is."""
    linear = tuple(n for n in structure(model) if n in learnt)
    groups = [group for group in (linear, *ABSENT) if group and set(group) <= set(names)]
    return [{n: model.nominal[n] if n in stated else 0.0 for n in group} for group in groups]


def refuse_zero(thought: Prior) -> None:
    """Refuse what has neither a size nor a sign, by which an estimate could move."""
    for name, scale in zip(thought.names, thought.scale, strict=True):
        if not scale:
            raise EstimatorError(
                f"{name} is told to be 0, which gives no size for its estimate; tell about how "
                f"large {name} may be, or leave it out of identify and track"
            )


def known_better(model: Model, thought: Prior, deviations: Mapping[str, float]) -> Prior:
    """Return what is thought with standard deviations as given."""
    if not isinstance(deviations, Mapping):
        raise EstimatorError(
            f"deviations is {deviations!r}; give standard deviations by the names of parameters"
        )
    known = [name.removeprefix("1/") for name in thought.names]
    for name in deviations:
        if name not in known and name not in model.parameters:
            raise EstimatorError(
                f"deviations names {name!r}, which is no parameter here: "
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
    Return which parameters are much better known than before: the excitation sees them.

    The others would only take up what is wrong with the model.

    Parameters
    ----------
    after, before : (p,) array_like
        Variances, in the same unit.
    """
    return np.asarray(np.sqrt(np.divide(after, before)) < SEEN)
