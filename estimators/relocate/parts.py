"""The parts of a filter that rewinds, made for one design."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flexaxis.estimators.methods.start import ROBUST
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.recursion.measurement import CEILING, measured
from flexaxis.estimators.recursion.records import Record, joined, record
from flexaxis.estimators.relocate.beginning import Beginning
from flexaxis.estimators.relocate.carried import Carried
from flexaxis.estimators.relocate.choices import choices
from flexaxis.estimators.relocate.colour import listening
from flexaxis.estimators.relocate.commission import Commission
from flexaxis.estimators.relocate.explain import Hypotheses
from flexaxis.estimators.relocate.follow import measuring
from flexaxis.estimators.relocate.lost import Lookout
from flexaxis.estimators.relocate.memory import SEARCHED, Memory
from flexaxis.estimators.relocate.policy import LATER, LOOKS, Policy
from flexaxis.estimators.relocate.rewind import Rewind
from flexaxis.estimators.relocate.rows import row_of
from flexaxis.estimators.relocate.suspects import Roles
from flexaxis.estimators.relocate.work import LOOP, of_sample, spread_over
from flexaxis.estimators.sampling.sampled import planned


class Parts(NamedTuple):
    """
    What a filter remembers, suspects, goes back by, begins with, looks out for, decides by.

    And the operations of a sample, whatever it carries.
    """

    memory: Memory
    hypotheses: Hypotheses
    rewind: Rewind
    commission: Commission
    lookout: Lookout
    policy: Policy
    sample: float


def parts_of(
    design: Design,
    roles: Roles,
    *,
    model: Model,
    told: Sequence[str],
    walk: float,
    alarm: float,
    gain: float,
    grain: float = np.inf,
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
    grain : float
        Operations of a piece of their work.
    """
    period, box, learns = design.period, (design.lower, design.upper), roles.known > roles.tracked
    fading = roles.fading(design.forgetting, len(design.theta0))
    # a prior is a ceiling of its own; θ(0), a law's, says not how uncertain it may be
    own = roles.known > roles.given
    ceiling = np.inf if own else CEILING
    tuning, state = _records(design, ceiling=ceiling, alarm=alarm)
    tuning["inflation"] = 1 / fading
    terms = planned(design.model, *box, period)
    rewind = Rewind(terms, box, roles, fading, grain)
    beginning = Beginning(terms, design, roles, model, tuple(told), grain) if own else None
    if beginning is not None:  # until the noise is known a prior has no size in units of it
        state["P"] = state["claim"] = 0.0
    policy = Policy(period, gain=gain)
    if learns:
        policy = replace(policy, looks=(*LOOKS, *LATER), adapting=True)
    return Parts(
        Memory(
            [Carried(choice, design, tuning, state) for choice in choices(design, roles)],
            row_of(design, state),
            tuning,
            state,
            period=period,
            evaluation=spread_over(terms, 1 + roles.tracked, round(SEARCHED / period), grain),
        ),
        Hypotheses(
            terms,
            box,
            roles.tracked,
            roles.candidates,
            promising=gain / 2 if learns else -np.inf,
        ),
        rewind,
        Commission(beginning, rewind, walk),
        Lookout(terms, box, identified=roles.tracked, period=period, grain=grain),
        policy,
        LOOP * of_sample(terms, 1 + len(design.theta0)),
    )


def _records(design: Design, *, ceiling: float, alarm: float) -> tuple[Record, Record]:
    """Return all that the loop needs of all parameters, besides those of the model."""
    measures = measured(design, clip=ROBUST, correct=True, ceiling=ceiling)
    listens = listening(alarm, design.period)
    place = record(count=0, stop=-1, guarded=0, y=0.0, valid=0)
    increments = design.output == "increment"
    angle = measuring(design.model, increments=increments, period=design.period)
    return joined(measures[0], listens[0], angle[0]), joined(
        measures[1], listens[1], place, angle[1]
    )
