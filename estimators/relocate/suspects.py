"""
What a filter does with each parameter: tracks it, learns it once, or carries it along as a suspect.

A tracked parameter is forgotten and so followed. One that is learnt has a prior and is never
forgotten: what is known of it only grows. A suspect stays as it is, its part of P zero, until it is
found to have changed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.model import Model, increment
from flexaxis.estimators.recursion.design import Design, above_zero

Array = NDArray[np.float64]

SUSPECT_BOX = (0.4, 2.5)  # times nominal
ADDITIVE_BOX = 10.0  # times its scale, for a parameter that may be zero


@dataclass(frozen=True)
class Roles:
    """
    Which parameters of a wide design are what, by their places.

    Attributes
    ----------
    named, tracked, known : int
        The first so many parameters are given as the estimate, are tracked, are no suspects: what
        is known but not tracked is learnt once.
    deviation : (known − named,) array
        Standard deviations of the priors of those that are not given, relative to their scale.
    candidates : (c,) int array
        Those that may be found to have changed.
    """

    named: int
    tracked: int
    known: int
    deviation: Array
    candidates: NDArray[np.int64]

    @property
    def prior(self) -> NDArray[np.int64]:
        """Places of the parameters that begin with a prior of their own."""
        return np.arange(self.named, self.known)

    def fading(self, forgetting: float, p: int) -> Array:
        """Return by what each element of P is divided in a sample, (p, p): λ, √λ or one."""
        fading = np.full((p, p), forgetting)
        learnt = slice(self.tracked, self.known)
        fading[learnt] = fading[:, learnt] = np.sqrt(forgetting)
        fading[learnt, learnt] = 1.0
        return fading


def widened(
    narrow: Design,
    model: Model,
    *,
    track: Mapping[str, float],
    learn: Mapping[str, float],
    suspects: Sequence[str],
) -> tuple[Design, Roles]:
    """
    Return a design with further parameters, and what each of its parameters is.

    Parameters
    ----------
    narrow : Design
        Of the identified parameters, which come first in the new one.
    model : Model
    track, learn : mapping of str to float
        Parameters that are tracked besides, and that are learnt once, with the standard deviations
        of their priors [SI].
    suspects : sequence of str
        Further parameters. One that is in use already is left out, and so is one whose nominal
        value is zero: it has no relative change.
    """
    p, names = len(narrow.theta0), narrow.model.names
    prior = dict(track) | dict(learn)
    for name, deviation in prior.items():
        above_zero(f"the prior of {name}", deviation, "a standard deviation in its unit")
    used = {name.removeprefix("1/") for name in (*names, *prior)}
    others = [name for name in suspects if name not in used and model.nominal.get(name) != 0]
    chosen = increment(model, narrow.period) if narrow.output == "increment" else model
    wide = chosen.parametrize([*names, *prior, *others])
    theta = wide.theta[p:]
    deviation = np.array([*prior.values(), *np.zeros(len(others))])
    zero = theta == 0
    own = np.where(zero, deviation, theta)
    start = theta / own
    P = np.zeros((len(wide.theta),) * 2)
    P[:p, :p] = narrow.P0
    scale = np.r_[narrow.scale, own]
    candidates = np.delete(np.arange(len(wide.theta)), p + np.flatnonzero(zero))
    design = replace(
        narrow,
        model=wide.relative(scale),
        scale=scale,
        theta0=np.r_[narrow.theta0, start],
        P0=P,
        drift=np.zeros_like(P),
        regularization=np.zeros(len(P)),
        lower=np.r_[narrow.lower, np.where(zero, -ADDITIVE_BOX, SUSPECT_BOX[0])],
        upper=np.r_[narrow.upper, np.where(zero, ADDITIVE_BOX, SUSPECT_BOX[1])],
    )
    relative = (deviation / np.abs(own))[: len(prior)]
    return design, Roles(p, p + len(track), p + len(prior), relative, candidates)
