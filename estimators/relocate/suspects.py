"""Parameters that a filter carries along without estimating, until they are found to change."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexaxis.estimators.models.model import Model, increment
from flexaxis.estimators.recursion.design import Design

SUSPECT_BOX = (0.4, 2.5)  # times nominal


def with_suspects(narrow: Design, model: Model, suspects: Sequence[str]) -> Design:
    """
    Return a design with further parameters, which stay as they are while their part of P is zero.

    Parameters
    ----------
    narrow : Design
        Of the identified parameters, which come first in the new one.
    model : Model
    suspects : sequence of str
        Further parameters. One that is identified already is left out, and so is one whose nominal
        value is zero: it has no relative change.
    """
    p, names = len(narrow.theta0), narrow.model.names
    known = {name.removeprefix("1/") for name in names}
    others = [name for name in suspects if name not in known and model.nominal.get(name) != 0]
    chosen = increment(model, narrow.period) if narrow.output == "increment" else model
    wide = chosen.parametrize([*names, *others])
    P = np.zeros((len(wide.theta),) * 2)
    P[:p, :p] = narrow.P0
    scale = np.r_[narrow.scale, wide.theta[p:]]
    rest = np.ones(len(others))
    return replace(
        narrow,
        model=wide.relative(scale),
        scale=scale,
        theta0=np.r_[narrow.theta0, rest],
        P0=P,
        drift=np.zeros_like(P),
        regularization=np.zeros(len(P)),
        lower=np.r_[narrow.lower, SUSPECT_BOX[0] * rest],
        upper=np.r_[narrow.upper, SUSPECT_BOX[1] * rest],
    )
