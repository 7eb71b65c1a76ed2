"""The parts of a filter that rewinds, made for one design."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flexaxis.estimators.methods.start import ROBUST
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.recursion.measurement import CEILING, measured
from flexaxis.estimators.recursion.records import joined, on_lanes
from flexaxis.estimators.relocate.beginning import Beginning
from flexaxis.estimators.relocate.commission import Commission
from flexaxis.estimators.relocate.explain import Hypotheses
from flexaxis.estimators.relocate.follow import measuring
from flexaxis.estimators.relocate.lost import Lookout
from flexaxis.estimators.relocate.memory import Memory
from flexaxis.estimators.relocate.policy import LATER, LOOKS, Policy
from flexaxis.estimators.relocate.rewind import Rewind
from flexaxis.estimators.relocate.suspects import Roles
from flexaxis.estimators.sampling.pattern import split
from flexaxis.estimators.sampling.sampled import planned


class Parts(NamedTuple):
    """What a filter remembers, suspects, goes back by, begins with, looks out for, decides by."""

    memory: Memory
    hypotheses: Hypotheses
    rewind: Rewind
    commission: Commission
    lookout: Lookout
    policy: Policy


def parts_of(
    design: Design,
    roles: Roles,
    *,
    model: Model,
    told: Sequence[str],
    walk: float,
    alarm: float,
    gain: float,
) -> Parts:
    """
    Return the parts of a filter.

    Parameters
    ----------
    design : Design
        With all parameters.
    roles : Roles
    model : Model
    told : sequence of str
        Parameters of its laws that are known already.
    walk : float
        Standard deviation of what is tracked after a second, relative to θ(0).
    alarm, gain : float
        Evidence that raises an alarm, and that a change needs [nats].
    """
    period, box, learns = design.period, (design.lower, design.upper), roles.known > roles.tracked
    fading = roles.fading(design.forgetting, len(design.theta0))
    pattern, _ = split(design.model)
    # a prior is a ceiling of its own; θ(0), a law's, says not how uncertain it may be
    own = roles.known > roles.given
    ceiling = np.inf if own else CEILING
    parts = measured(design, clip=ROBUST, correct=True, ceiling=ceiling)
    records = on_lanes(design, pattern), parts
    tuning, state = (joined(*pair) for pair in zip(*records, strict=True))
    tuning["inflation"] = 1 / fading
    angle = measuring(design.model, increments=design.output == "increment", period=period)
    terms = planned(design.model, *box, period)
    rewind = Rewind(terms, box, roles, fading)
    beginning = Beginning(terms, design, roles, model, tuple(told)) if own else None
    if beginning is not None:  # until the noise is known a prior has no size in units of it
        state["P"] = state["claim"] = 0.0
    policy = Policy(period, gain=gain)
    if learns:
        policy = replace(policy, looks=(*LOOKS, *LATER), adapting=True)
    return Parts(
        Memory(pattern, tuning, state, alarm=alarm, period=period, angle=angle),
        Hypotheses(
            terms,
            box,
            roles.tracked,
            roles.candidates,
            promising=gain / 2 if learns else -np.inf,
        ),
        rewind,
        Commission(beginning, rewind, walk),
        Lookout(terms, box, identified=roles.tracked, period=period),
        policy,
    )
