"""What a filter may carry from sample to sample: which parameters, and which laws act."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.laws import KINDS
from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.relocate.suspects import Roles

Places = NDArray[np.int64]

SIZES = 2  # roles of a law, the first, that are zero where it does nothing
ALONE = ("bristle", "sinusoid")
"""Laws of which an axis may well have one and no other: dry friction, cogging."""


class Choice(NamedTuple):
    """
    What is carried.

    Attributes
    ----------
    places : (q,) int array
        Of the parameters, in their order.
    laws : tuple of int
        Which laws act.
    absent : (a,) int array
        Parameters that are zero where the other laws do nothing.
    """

    places: Places
    laws: tuple[int, ...]
    absent: Places


def choices(design: Design, roles: Roles) -> list[Choice]:
    """
    Return what a filter may carry, the narrowest first and everything last.

    That is what is tracked. Where there are laws, it is what is tracked of a linear axis, and of
    one with dry friction or cogging alone.

    Parameters
    ----------
    design : Design
        Of all parameters.
    roles : Roles
    """
    p, laws = len(design.theta0), design.model.laws
    if laws is None:
        counts = sorted({roles.tracked, p})
        return [Choice(np.arange(q), (), np.arange(0)) for q in counts]
    every = tuple(range(len(laws.kind)))
    maybe = [i for i in every if _may_be_absent(design, i)]
    alone = [i for i in maybe if KINDS[laws.kind[i]] in ALONE]
    without = [maybe, *([j for j in maybe if j != i] for i in alone)] if maybe else []
    few = [_without(design, roles, gone) for gone in without]
    return [*few, Choice(np.arange(p), every, np.arange(0))]


def _without(design: Design, roles: Roles, gone: list[int]) -> Choice:
    """Return what is tracked and what belongs to laws, if some of these are absent."""
    laws = design.model.laws
    assert laws is not None  # its caller has some
    kept = tuple(i for i in range(len(laws.kind)) if i not in gone)
    of_kept, of_gone = set(laws.parameter[list(kept)].flat), set(laws.parameter[gone].flat)
    places = [
        j for j in range(roles.known) if (j < roles.tracked or j in of_kept) and j not in of_gone
    ]
    return Choice(np.array(places), kept, laws.parameter[gone, :SIZES].ravel())


def _may_be_absent(design: Design, law: int) -> bool:
    """Whether a law has parameters without which it does nothing."""
    laws = design.model.laws
    assert laws is not None  # its caller has some
    return bool(np.all(laws.parameter[law, :SIZES] >= 0))
