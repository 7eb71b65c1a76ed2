"""Interacting multiple models of an axis with friction: it tracks what changes, learns the rest."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from flexaxis.estimators.entry import Entry
from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.methods.start import Nominal
from flexaxis.estimators.models.axes import PAPER
from flexaxis.estimators.models.meaning import fixable as fixable_of
from flexaxis.estimators.models.meaning import structure
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.sizes import state_sizes
from flexaxis.estimators.offline.structure import (
    TRACKED,
    Prior,
    prior,
    structure_names,
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
ABSENT = (("kappa", "gap"), ("c_sin", "c_cos"), ("f_c", "f_s"), ("f_s",))
"""What of the laws is zero on many an axis, in the groups in which it is."""


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
    track = _names("track", track, (*may, *TRACKED))
    tracked = (*identify, *(name for name in track if _is_left(model, name, identify)))
    learnt = _learnt(model, tracked, learn)
    names = (*tracked, *learnt)
    model = _without(model, [n for n in ("f_s", "gap") if n not in (*names, *told)])
    thought = prior(model, names, torque=torque, period=period, told=told, spread=spread)
    _no_zero(thought)
    thought = thought if deviations is None else _known_better(thought, deviations)
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
    suspects = _names("suspects", suspects, (*may, *SUSPECTS))
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
        told=_told_groups(model, names, learnt, stated),
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


def _is_left(model: Model, name: str, identify: Sequence[str]) -> bool:
    """Whether a model has a parameter that is not identified already, itself or inverted."""
    physical = name.removeprefix("1/")
    return physical in model.parameters and physical not in {n.removeprefix("1/") for n in identify}


def _without(model: Model, absent: Sequence[str]) -> Model:
    """Return a model of the suite without what is neither told nor learnt."""
    left_out = dict.fromkeys((n for n in absent if model.name == "real_axis"), 0.0)
    return replace(model, nominal=dict(model.nominal) | left_out)


def _learnt(model: Model, tracked: Sequence[str], learn: Sequence[str] | str) -> tuple[str, ...]:
    """Return what is learnt once; of "auto" all but what is zero, which gives it no size."""
    found = structure_names(model, tracked)
    if learn == "auto":
        return tuple(n for n in found if n in model.law_parameters or model.nominal[n])
    if learn == "none":
        return ()
    return _names("learn", learn, found)


def _told_groups(
    model: Model, names: Sequence[str], learnt: Sequence[str], stated: Sequence[str]
) -> list[dict[str, float]]:
    """Return to what groups of parameters are drawn: as stated, and zero where nothing is."""
    linear = tuple(n for n in structure(model) if n in learnt)
    groups = [group for group in (linear, *ABSENT) if group and set(group) <= set(names)]
    return [{n: model.nominal[n] if n in stated else 0.0 for n in group} for group in groups]


def _no_zero(thought: Prior) -> None:
    """Refuse what has neither a size nor a sign, by which an estimate could move."""
    for name, scale in zip(thought.names, thought.scale, strict=True):
        if not scale:
            raise EstimatorError(
                f"{name} is told to be 0, which gives no size for its estimate; tell about how "
                f"large {name} may be, or leave it out of identify and track"
            )


def _names(option: str, given: object, allowed: Sequence[str]) -> tuple[str, ...]:
    """Return names that an option gives, refused where there is no such parameter."""
    if isinstance(given, str) or not isinstance(given, Sequence | np.ndarray):
        raise EstimatorError(
            f"{option} is {given!r}; give names among {', '.join(allowed)}"
            + ("; or 'auto' or 'none'" if option == "learn" else "")
        )
    for name in given:
        if name not in allowed:
            raise EstimatorError(
                f"{option} names {name!r}, which is no parameter for that: "
                + did_you_mean(str(name), allowed)
            )
    return tuple(dict.fromkeys(given))


def _known_better(thought: Prior, deviations: Mapping[str, float]) -> Prior:
    """Return what is thought with standard deviations as given."""
    if not isinstance(deviations, Mapping):
        raise EstimatorError(
            f"deviations is {deviations!r}; give standard deviations by the names of parameters"
        )
    deviation = thought.deviation.copy()
    for i, name in enumerate(thought.names):
        physical = name.removeprefix("1/")
        if physical in deviations:
            given = above_zero(f"deviations[{physical!r}]", deviations[physical], "its deviation")
            deviation[i] = given if name == physical else given * thought.start[i] ** 2
    return replace(thought, deviation=deviation)


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
