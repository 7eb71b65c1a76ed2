"""A joint Kalman filter with a bank of hypotheses: it tracks jumps, and learns the rest once."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from flexaxis.estimators.entry import Entry
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.glr.filter import Glr
from flexaxis.estimators.glr.records import Jumps, Timing
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
from flexaxis.estimators.offline.structure import TRACKED, prior, told_of, with_laws
from flexaxis.estimators.recursion.design import above_zero, at_least_zero, make_design
from flexaxis.estimators.recursion.joint import state_covariance
from flexaxis.estimators.recursion.seen import AS_ABSENT, AS_TOLD

WALK = 7e-4  # 1/√s, of θ over its scale: 1 % in a quarter of an hour
FRICTION = 4.5  # times as far that friction walks, which warms: 2.4 % in a minute
STRUCTURE = 3e-4  # 1/√s, of what is learnt once: what the first seconds got wrong is taken up
JUMP = 0.3  # of θ over its scale: faults are of 10 to 100 %
RATE = 1e-3  # 1/s, of jumps of all parameters together: one in a quarter of an hour
SUSPECTED = 0.1  # how often what is learnt once jumps, over how often what is tracked does
SPREAD = 0.2  # of θ(0) over itself, of what is tracked
BUDGET = 16  # samples that are gone through again, at most, in one
FIRST, REVIEW, MISFIT = 10.0, 2.6, 26.0  # time scales of the axis: of motion until structure is
# learnt, until a name is final, and of the memory of how well the model fits
SPAN, FINEST = 2.8, 80  # time scales that the bank covers at least, and its finest spacings in one
FEWEST, MOST = 80, 800  # samples of the time scale of an axis that does not swing
PASSES = 6  # through the first seconds, at most


def glr(
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str] = PAPER,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    learn: Sequence[str] | str = "auto",
    track: Sequence[str] = TRACKED,
    suspects: Sequence[str] | str = "auto",
    deviations: Mapping[str, float] | None = None,
    walk: float = WALK,
    jump: float = JUMP,
    rate: float = RATE,
    noise: float | None = None,
    spread: float = SPREAD,
    budget: int = BUDGET,
    commissioning: float | None = None,
) -> Glr:
    """
    Make the filter with a bank of hypotheses for an axis with or without friction.

    All lengths of time follow from one time scale of the axis, see `time_scale`.

    Parameters
    ----------
    nominal : mapping of str to float, or Model
        Nominal values, with a data sheet's ``poles``, ``torque_limit`` and ``noise`` where it says
        so; or a model with laws of its own. What `Glr.commissioned` gives may be among them.
    P0
        Taken as by every entry, and left: P(0) is that of what is thought of each parameter.
    torque : (N,) array_like, optional
        Torque of a nominal run, from which the sizes of friction and play are taken.
    learn : "auto", "none" or sequence of str
        What is learnt once. Of all that the model has, "auto" learns what the first seconds show;
        the rest is fixed as told, and `Glr.fixed_because` says so.
    track : sequence of str
        What may change in use and is estimated, besides ``identify``.
    suspects : "auto" or sequence of str
        What of ``learn`` may jump all the same, to be named; springs, dampers and the motor's
        inertia by default.
    deviations : mapping of str to float, optional
        Standard deviations of physical parameters, in their units, such as those of
        `Glr.commissioned`; then nothing is learnt in the first seconds by default.
    walk : float
        Standard deviation of the random walk of tracked parameters after a second, over their
        scale; friction walks 4.5 times as far.
    jump : float
        Standard deviation of a jump, over the scale.
    rate : float
        How often a jump comes [1/s].
    noise : float, optional
        Standard deviation of the output, in its unit; else that of the data sheet, or learnt.
    spread : float
        Standard deviation of what is tracked at the start, relative to it.
    budget : int
        Samples that are gone through again in one sample, at most, to make a candidate exact.
    commissioning : float, optional
        How long the axis moves until its structure is learnt [s]; ten time scales by default.

    Raises
    ------
    EstimatorError
        If an option cannot be used.
    """
    _check(period=period, walk=walk, jump=jump, rate=rate, spread=spread, budget=budget)
    model = with_laws(nominal, torque=torque, period=period)
    told = told_of(nominal)
    if noise is None and not isinstance(nominal, Model):
        noise = nominal.get("noise")
    inverses = (f"1/{p}" for p in model.parameters if p not in model.law_parameters)
    may = (*model.parameters, *inverses)
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
    suspects = structure(model) if suspects == "auto" else names_of("suspects", suspects, may)
    if odd := [name for name in suspects if name not in (*names, *structure(model))]:
        raise EstimatorError(
            f"suspects names {odd[0]!r}, which is not learnt; of what is learnt there are "
            f"{', '.join(learnt) or 'none'}"
        )
    which = (*tracked, *(name for name in suspects if name in learnt))
    rates = np.where(np.arange(len(which)) < len(tracked), 1.0, SUSPECTED)
    return Glr(
        design,
        tracked=len(tracked),
        jumps=Jumps(
            which=tuple(names.index(name) for name in which),
            size=np.full(len(which), jump),
            rate=rate * rates / rates.sum(),
            walk=_walk(model, names, len(tracked), walk) * period,
        ),
        timing=_timing(model, period, int(budget), commissioning, deviations is not None),
        told=told_groups(model, names, learnt, stated),
        fixable={n: AS_TOLD if n in stated else AS_ABSENT for n in fixable},
        x0_covariance=state_covariance(design, state_sizes(model, torque, period) ** 2),
    )


def time_scale(model: Model, period: float) -> float:
    """
    Return the time in which an axis forgets [s]: that of its slowest oscillation.

    What does not swing has its slowest pole's, within `FEWEST` and `MOST` samples: how long a
    motor coasts says nothing of how soon a torque shows.

    Parameters
    ----------
    model : Model
    period : float
        Sampling period [s].
    """
    linear = replace(model, laws=())
    one = linear.parametrize(linear.parameters[:1])
    poles = np.linalg.eigvals(one.matrices(one.theta)[0])
    rates = np.abs(poles.real)
    moves = rates > 1e-6 * np.abs(poles).max(initial=0.0)
    swings = moves & (np.abs(poles.imag) > rates)
    if swings.any():
        return float(1.0 / rates[swings].min())
    slowest = 1.0 / rates[moves].min() if moves.any() else np.inf
    return float(np.clip(slowest, FEWEST * period, MOST * period))


def _timing(
    model: Model, period: float, budget: int, commissioning: float | None, known: bool
) -> Timing:
    """Return lengths in samples, from the time scale of the axis."""
    scale = time_scale(model, period)
    if commissioning is None:
        commissioning = 0.0 if known else FIRST * scale
    at_least_zero("commissioning", commissioning, "how long the first seconds are, in seconds")
    samples = scale / period
    base = max(1, round(samples / FINEST))
    levels = max(1, int(np.ceil(np.log2(SPAN * samples / (8 * base)))) + 1)
    return Timing(
        base=base,
        levels=levels,
        first=round(commissioning / period),
        review=round(REVIEW * samples),
        memory=round(MISFIT * samples),
        budget=budget,
        passes=PASSES,
    )


def _walk(model: Model, names: Sequence[str], tracked: int, walk: float) -> np.ndarray:
    """Return what the variances of θ (p,) gain in a second, over the squared scale."""
    deviation = np.full(len(names), STRUCTURE / WALK * walk)
    for i, name in enumerate(names[:tracked]):
        physical = name.removeprefix("1/")
        warms = physical in model.nonnegative or physical in model.law_parameters
        deviation[i] = walk * (FRICTION if warms else 1.0)
    return deviation**2


def _check(*, budget: int, **options: float) -> None:
    """Refuse options that are not above zero, and a budget with which nothing catches up."""
    what = {
        "period": "the sampling period in seconds",
        "walk": "the standard deviation of θ after a second, over its scale",
        "jump": "the standard deviation of a jump, over the scale of θ",
        "rate": "how often a jump comes, in 1/s",
        "spread": "the standard deviation of θ(0), relative to it",
    }
    for name, value in options.items():
        above_zero(name, value, what[name])
    if options["rate"] * options["period"] >= 1:
        raise EstimatorError(
            f"rate is {options['rate']}; a jump comes less than once in a sample of "
            f"{options['period']} s"
        )
    given = at_least_zero("budget", budget, "how many samples are gone through again in one")
    if given < 4 or given != int(given):
        raise EstimatorError(
            f"budget is {budget!r}; give 4 samples or more, whole ones, that are gone through "
            "again in one"
        )


ENTRIES = (
    Entry(
        "glr",
        "joint Kalman filter with a bank of hypotheses: which parameter jumped, when, by how much",
        glr,
        knob="walk",
        default=WALK,
        rank=9.7,
        laws=True,
    ),
)
