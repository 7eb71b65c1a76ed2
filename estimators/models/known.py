"""Whether a model is an axis that has a name: what was found on that axis holds on it alone."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axes import MODELS
from flexaxis.estimators.models.model import Model

NEAR = 2.5
"""
Factor within which the poles agree of a model that moves as a named axis does.

So a start at half or twice the truth is still that axis. The motor of the stress case "n2" coasts
11 times as long as that of "n1".
"""
STARTED = 4.0  # factor by which an identified parameter may start off its nominal value
SAME = 1e-9  # relative, of all other values


def is_axis(model: Model, name: str, identify: Sequence[str]) -> bool:
    """
    Return whether a model is a named axis, in its units.

    Parameters
    ----------
    model : Model
    name : str
        As in `known` of `flexaxis.estimators.models.axes.MODELS`.
    identify : sequence of str
        Parameters, or inverses, whose values are where an estimate starts.
    """
    named = _named(name)
    tables = ("states", "A", "B", "C", "reset")
    if any(getattr(model, table) != getattr(named, table) for table in tables):
        return False
    free = {parameter.removeprefix("1/") for parameter in identify}
    for parameter, value in named.nominal.items():
        ratio = model.nominal[parameter] / value
        if not (1 / STARTED <= ratio <= STARTED if parameter in free else abs(ratio - 1) <= SAME):
            return False
    return True


def moves_as(model: Model, name: str) -> bool:
    """
    Return whether a model has about the poles of a named axis, in whatever units.

    Parameters
    ----------
    model : Model
    name : str
        As for `is_axis`.
    """
    ours, theirs = _rates(model), _rates(_named(name))
    if len(ours) != len(theirs) or not ours.all():
        return False
    return bool(np.abs(np.log(ours / theirs)).max() <= np.log(NEAR))


def named_values(name: str, identify: Sequence[str]) -> NDArray[np.float64]:
    """Return θ (p,) of a named axis [SI]; NaN for what it has not."""
    values = _named(name).nominal
    return np.array(
        [
            values.get(n.removeprefix("1/"), np.nan) ** (-1.0 if n.startswith("1/") else 1.0)
            for n in identify
        ]
    )


def _named(name: str) -> Model:
    return next(m.factory(m.known[name]) for m in MODELS.values() if name in m.known)


def _rates(model: Model) -> NDArray[np.float64]:
    """Return the sizes (n,) of the poles in order [1/s]."""
    one = model.parametrize(model.parameters[:1])
    return np.sort(np.abs(np.linalg.eigvals(one.matrices(one.theta)[0])))
