"""Interacting multiple models of an axis with friction: it tracks what changes, learns the rest."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from flexaxis.estimators.entry import Entry
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.methods.start import Nominal
from flexaxis.estimators.models.axes import PAPER
from flexaxis.estimators.models.meaning import fixable as fixable_of
from flexaxis.estimators.models.meaning import structure
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.roles import (
    is_left,
    known_better,
    learnt_of,
    names_of,
    refuse_zero,
    told_groups,
    without,
)
from flexaxis.estimators.offline.sizes import state_sizes
from flexaxis.estimators.offline.structure import (
    TRACKED,
    prior,
    told_of,
    with_laws,
)
from flexaxis.estimators.recursion.design import above_zero, at_least_zero, make_design
from flexaxis.estimators.recursion.joint import state_covariance
from flexaxis.estimators.recursion.modal import Modes
from flexaxis.estimators.recursion.seen import AS_ABSENT, AS_TOLD
from flexaxis.estimators.recursion.tracker import Tracker

WALK = 7e-4  # 1/√s, of θ over its scale: 1 % in a minute, about what warming does
JUMP = 0.22  # of θ over its scale, of a jump: faults are of 10 to 50 %
RATE = 1e-3  # 1/s, of jumps: one in a quarter of an hour
HOLD = 0.1  # s, of a jump: what is unknown of it is seen in about that time
SPREAD = 0.2  # of θ(0) over itself, of what is tracked
COMMISSIONING = 4.0  # s, in which the excitation of the suite has moved all
SUSPECTS = ("J_m", "k_g")  # of what is learnt once, what a fault or a payload may change
SUSPECTED = 0.1  # how often these jump, over how often what is tracked does


def imm_friction(
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str] = PAPER,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    learn: Sequence[str] | str = "auto",
    track: Sequence[str] = TRACKED,
    suspects: Sequence[str] = SUSPECTS,
    deviations: Mapping[str, float] | None = None,
    walk: float = WALK,
    jump: float = JUMP,
    rate: float = RATE,
    hold: float = HOLD,
    noise: float | None = None,
    spread: float = SPREAD,
    commissioning: float | None = None,
) -> Tracker:
    """
    Make the interacting multiple models of an axis with dry friction, play and cogging.

    Parameters
    ----------
    nominal : mapping of str to float, or Model
        Nominal values, with a data sheet's ``poles``, ``torque_limit`` and ``noise`` where it says
        so; or a model with laws of its own. What `Tracker.commissioned` gives may be among them.
    P0
        Taken as by every entry, and left: P(0) is that of what is thought of each parameter.
    torque : (N,) array_like, optional
        Torque of a nominal run, from which the sizes of friction and play are taken.
    learn : "auto", "none" or sequence of str
        What is learnt once, as a state without a walk. Of all that the model has, "auto" learns
        what the first seconds show; the rest is fixed as told, and `Tracker.fixed_because` says so.
    track : sequence of str
        What may change in use and is estimated, besides ``identify``.
    suspects : sequence of str
        What of ``learn`` may jump all the same, to be named.
    deviations : mapping of str to float, optional
        Standard deviations of physical parameters, in their units, such as those of
        `Tracker.commissioned`; then nothing is commissioned by default.
    walk : float
        Standard deviation of the random walk of tracked parameters after a second, over their
        scale.
    jump : float
        Standard deviation of a jump, over the scale.
    rate, hold : float
        How often a jump comes [1/s], and how long it lasts on average [s].
    noise : float, optional
        Standard deviation of the output, in its unit; else that of the data sheet, or learnt.
    spread : float
        Standard deviation of what is tracked at the start, relative to it.
    commissioning : float, optional
        How long the first seconds are [s], 4 by default.
    """
    _check(period=period, walk=walk, jump=jump, rate=rate, hold=hold, spread=spread)
    model = with_laws(nominal, torque=torque, period=period)
    told = told_of(nominal)
    if noise is None and not isinstance(nominal, Model):
        noise = nominal.get("noise")
    may = (
        *model.parameters,
        *(f"1/{p}" for p in model.parameters if p not in model.law_parameters),
    )
    track = names_of("track", track, (*may, *TRACKED))
    tracked = (*identify, *(name for name in track if is_left(model, name, identify)))
    learnt = learnt_of(model, tracked, learn)
    names = (*tracked, *learnt)
    model = without(model, [n for n in ("f_s", "gap") if n not in (*names, *told)])
    thought = prior(model, names, torque=torque, period=period, told=told, spread=spread)
    refuse_zero(thought)
    thought = thought if deviations is None else known_better(model, thought, deviations)
    design = make_design(
        model,
        identify=names,
        theta0=thought.start,
        P0=thought.P0,
        period=period,
        bounds=thought.bounds,
        output=output,
        noise=noise,
        scale=thought.scale,
    )
    stated = (*told, *structure(model))  # which every axis has
    fixable = fixable_of(model) if learn == "auto" else ()
    if commissioning is None:
        commissioning = COMMISSIONING if deviations is None else 0.0
    at_least_zero("commissioning", commissioning, "how long the first seconds are, in seconds")
    rests = state_covariance(design, state_sizes(model, torque, period) ** 2)
    suspects = names_of("suspects", suspects, (*may, *SUSPECTS))
    which = (*tracked, *(name for name in suspects if name in learnt))
    rates = np.where(np.arange(len(which)) < len(tracked), 1.0, SUSPECTED)
    W = np.zeros(len(names))
    W[: len(tracked)] = walk**2 * period
    modes = Modes(
        which=tuple(names.index(name) for name in which),
        walk=W,
        jump=np.full(len(which), jump**2 * period / hold),
        rate=rate * rates / rates.sum(),
        hold=hold,
    )
    return Tracker(
        design,
        tracked=len(tracked),
        modes=modes,
        told=told_groups(model, names, learnt, stated),
        fixable={n: AS_TOLD if n in stated else AS_ABSENT for n in fixable},
        x0_covariance=rests,
        commissioning=round(commissioning / period),
    )


def _check(**options: float) -> None:
    """Refuse options that are not above zero, or a chain of modes that is none."""
    what = {
        "period": "the sampling period in seconds",
        "walk": "the standard deviation of θ after a second, over its scale",
        "jump": "the standard deviation of a jump, over the scale of θ",
        "rate": "how often a jump comes, in 1/s",
        "hold": "how long a jump lasts, in seconds",
        "spread": "the standard deviation of θ(0), relative to it",
    }
    for name, value in options.items():
        above_zero(name, value, what[name])
    if options["rate"] * options["period"] >= 1 or options["hold"] <= options["period"]:
        raise EstimatorError(
            f"rate is {options['rate']} and hold {options['hold']}; a jump comes less than once "
            f"and lasts more than one sample of {options['period']} s"
        )


ENTRIES = (
    Entry(
        "imm-friction",
        "interacting multiple models of an axis with dry friction: tracks changes, learns the rest",
        imm_friction,
        knob="walk",
        default=WALK,
        rank=9.5,
        laws=True,
    ),
)
