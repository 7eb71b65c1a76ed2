"""
What a filter does with each parameter: tracks it, learns it once, or carries it along as a suspect.

A tracked parameter is forgotten and so followed. One that is learnt has a prior and is never
forgotten: what is known of it only grows. A suspect stays as it is, its part of P zero, until it is
found to have changed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.meaning import nonnegative_of_laws, strengths
from flexaxis.estimators.models.model import Model, increment
from flexaxis.estimators.offline.sizes import natural_motion
from flexaxis.estimators.offline.structure import prior as thought
from flexaxis.estimators.recursion.design import Design

Array = NDArray[np.float64]

SUSPECT_BOX = (0.4, 2.5)  # times nominal
LAW_BOX = 1e-9, 1e6  # times a scale that depends on units: no more than a guard


@dataclass(frozen=True)
class Roles:
    """
    Which parameters of a wide design are what, by their places.

    Attributes
    ----------
    given, tracked, known : int
        The first so many parameters have a P(0) that is given, are tracked, are no suspects: what
        is known but not tracked is learnt once.
    candidates : (c,) int array
        Those that may be found to have changed.
    """

    given: int
    tracked: int
    known: int
    candidates: NDArray[np.int64]

    @property
    def prior(self) -> NDArray[np.int64]:
        """Places of the parameters that begin with a prior of their own."""
        return np.arange(self.given, self.known)

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
    track: Sequence[str],
    learn: Sequence[str],
    told: Sequence[str],
    suspects: Sequence[str],
) -> tuple[Design, Roles]:
    """
    Return a design with further parameters, and what each of its parameters is.

    Parameters
    ----------
    narrow : Design
        Of the identified parameters, which come first in the new one.
    model : Model
    track, learn, told : sequence of str
        Parameters that are tracked besides, that are learnt once, and those of laws that are known
        already.
    suspects : sequence of str
        Further parameters. One that is in use already is left out, and so is one whose nominal
        value is zero: it has no relative change.
    """
    p, names = len(narrow.theta0), narrow.model.names
    prior = (*track, *learn)
    used = {name.removeprefix("1/") for name in (*names, *prior)}
    others = [name for name in suspects if name not in used and model.nominal.get(name) != 0]
    chosen = increment(model, narrow.period) if narrow.output == "increment" else model
    wide = chosen.parametrize([*names, *prior, *others])
    theta, law = wide.theta[p:], np.array(wide.additive[p:], bool)
    own = theta.copy()
    if prior:  # a size that is not zero
        sized = thought(model, prior, period=narrow.period, motion=natural_motion(model))
        own[: len(prior)] = np.where(theta[: len(prior)] != 0, theta[: len(prior)], sized.scale)
    P = np.zeros((len(wide.theta),) * 2)
    P[:p, :p] = narrow.P0
    scale = np.r_[narrow.scale, own]
    positive = np.isin(wide.names[p:], nonnegative_of_laws(model))
    least = np.where(law, np.where(positive, LAW_BOX[0], -LAW_BOX[1]), SUSPECT_BOX[0])
    inert = np.isin(wide.names[p:], [n for n in strengths(model) if n in prior and n not in told])
    design = replace(
        narrow,
        model=wide.relative(scale),
        scale=scale,
        theta0=np.r_[narrow.theta0, np.where(inert, np.maximum(least, 0.0), theta / own)],
        P0=P,
        drift=np.zeros_like(P),
        regularization=np.zeros(len(P)),
        lower=np.r_[narrow.lower, least],
        upper=np.r_[narrow.upper, np.where(law, LAW_BOX[1], SUSPECT_BOX[1])],
    )
    tracked = p + len(track)
    candidates = np.r_[np.arange(tracked), tracked + np.flatnonzero(~law[len(track) :])]
    return design, Roles(p, tracked, p + len(prior), candidates)
