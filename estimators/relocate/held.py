"""A model in which some of the parameters are numbers, and laws that do nothing are left out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.laws import Acting
from flexaxis.estimators.models.parametrization import Parametrization

Array = NDArray[np.float64]
Places = NDArray[np.int64]


def rows_with(model: Parametrization, laws: Sequence[int]) -> Places:
    """Return which rows of [x; y] remain where only these of the laws act."""
    if model.laws is None:
        return np.arange(model.n + 1)
    own = model.laws.memory
    gone = [i for i in range(len(own)) if i not in laws]
    dropped = {int(own[i]) for i in gone} | {model.states + i for i in gone}
    return np.array([i for i in range(model.n + 1) if i not in dropped])


def held(
    model: Parametrization, theta: Array, places: Places, laws: Sequence[int]
) -> Parametrization:
    """
    Return a model as a function of some of its parameters, the others held at their values.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array
        Values of all parameters.
    places : (q,) int array
        Which of them remain parameters.
    laws : sequence of int
        Which of its laws act; the states of the others are left out.
    """
    rows = rows_with(model, laws)
    fixed = ~np.isin(np.arange(len(theta)), places)
    place = np.full(model.n + 1, -1)
    place[rows] = np.arange(len(rows))
    row, column = place[model.row], place[model.column]
    there = (row >= 0) & (column >= 0)
    powers = theta[fixed] ** model.exponent[:, fixed].astype(float)
    return replace(
        model,
        names=tuple(model.names[i] for i in places),
        theta=theta[places],
        n=len(rows) - 1,
        row=row[there],
        column=column[there],
        coefficient=(model.coefficient * np.prod(powers, axis=1))[there],
        exponent=model.exponent[:, places][there],
        reset=tuple(int(place[i]) for i in model.reset),
        laws=_acting(model, theta, places, laws, place),
        additive=tuple(model.additive[i] for i in places),
    )


def _acting(
    model: Parametrization, theta: Array, places: Places, laws: Sequence[int], place: Places
) -> Acting | None:
    """Return the laws that remain, with states where ``place`` says."""
    if model.laws is None or not len(laws):
        return None
    all_of, kept = model.laws, list(laws)
    memory, value, parameter = all_of.memory[kept], all_of.value[kept], all_of.parameter[kept]
    where = np.full(len(theta) + 1, -1)  # the last for what is no parameter
    where[places] = np.arange(len(places))
    held_at = np.where((parameter >= 0) & (where[parameter] < 0), np.r_[theta, 1.0][parameter], 1.0)
    inputs = np.r_[place[: model.states] >= 0, True]
    own = np.where(memory >= 0, place[memory], -1)
    return Acting(
        all_of.kind[kept], own, all_of.drive[kept][:, inputs], value * held_at, where[parameter]
    )
