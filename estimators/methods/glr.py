"""A joint Kalman filter with a bank of hypotheses about jumps of parameters."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from flexaxis.estimators.filters.design import above_zero, flag, make_design
from flexaxis.estimators.glr.cogging import FASTEST
from flexaxis.estimators.glr.filter import Glr
from flexaxis.estimators.glr.records import Jumps, lengths
from flexaxis.estimators.models.axes import with_cogging
from flexaxis.estimators.models.meaning import fixable as fixable_of
from flexaxis.estimators.models.meaning import shapes_of_friction, structure
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.roles import (
    AS_ABSENT,
    AS_TOLD,
    is_left,
    known_better,
    learnt_of,
    names_of,
    refuse_zero,
    told_groups,
    without,
)
from flexaxis.estimators.offline.structure import (
    TRACKED,
    matrices,
    measured,
    prior,
    state_sizes,
    told_of,
    with_laws,
)
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry

WALK = 7e-4  # 1/√s, of θ over its scale: 1 % in a quarter of an hour
FRICTION = 4.5  # times as far that friction walks, which warms: 2.4 % in a minute
STRUCTURE = 3e-4  # 1/√s, of parameters that are learnt once, to correct errors of initialisation
JUMP = 0.3  # of θ over its scale: faults are of 10 to 100 %
RATE = 1e-3  # 1/s, of jumps of all parameters together: one in a quarter of an hour
SUSPECTED = 0.1  # rate of jumps of parameters that are learnt once, relative to tracked ones
TORQUE_NOISE = 0.3  # initial standard deviation of unmodelled torque over the rms torque
# (only if y is an angle). Without it, the first exact readings make k_T wrong by 30 %; with 0.1 to
# 0.3 it is right within 0.1 % (erob80, seeds 0-3)
SPREAD = 0.2  # standard deviation of θ(0), relative to θ(0), of tracked parameters


def glr(
    problem: Problem,
    *,
    learn: Sequence[str] | str = "auto",
    track: Sequence[str] = TRACKED,
    deviations: Mapping[str, float] | None = None,
    walk: float = WALK,
    spread: float = SPREAD,
    gear: bool = False,
    commissioning: float | None = None,
) -> Glr:
    """
    Make the filter with a bank of hypotheses for an axis with or without friction.

    One time scale of the axis sets all times, see `flexaxis.estimators.glr.records.lengths`.

    Parameters
    ----------
    problem : Problem
        The nominal values, with ``poles``, ``torque_limit`` and ``noise`` of a data sheet if known,
        or a model with its own laws. The torque sets the scale of friction and backlash. P(0)
        follows from the prior of each parameter.
    learn : "auto", "none" or sequence of str
        Parameters that are learnt once; springs, dampers and the motor inertia among them may
        jump. "auto" learns all parameters that the initialisation data excite and fixes the others
        at their nominal values; `Glr.fixed_because` gives the reasons.
    track : sequence of str
        Tracked parameters in addition to ``identify``.
    deviations : mapping of str to float, optional
        Standard deviations of physical parameters, in their units. If given, there is no
        initialisation by default.
    walk : float
        Standard deviation of the random walk of tracked parameters after a second, over their
        scale; friction walks 4.5 times as far.
    spread : float
        Initial standard deviation of tracked parameters, relative to their values.
    gear : bool
        Whether friction grows with the gear load, as in a servo drive. It has no effect on a model
        with its own laws, or if bristle parameters are given or tracked.
    commissioning : float, optional
        Time of motion for initialisation [s]; ten time scales by default.

    Raises
    ------
    EstimatorError
        If an option cannot be used.
    """
    nominal, period, noise = problem.nominal, problem.period, problem.noise
    above_zero("walk", walk, "the standard deviation of θ after a second, over its scale")
    above_zero("spread", spread, "the standard deviation of θ(0), relative to it")
    asked = {*problem.identify, *np.ravel(track)}  # checked where they are used
    bristles = {"sigma_0", "sigma_1"} & {*told_of(nominal), *asked}
    geared = flag("gear", gear) and not bristles
    model = with_laws(nominal, torque=problem.torque, period=period, geared=geared)
    told = told_of(nominal)
    if noise is None and not isinstance(nominal, Model):
        noise = nominal.get("noise")
    made = partial(
        _made,
        problem=problem,
        told=told,
        learn=learn,
        track=track,
        deviations=deviations,
        walk=walk,
        noise=noise,
        spread=spread,
        commissioning=commissioning,
    )
    learns = learn == "auto" and deviations is None and commissioning != 0
    told_laws = isinstance(nominal, Model) or {"mu_m", "poles"} & model.nominal.keys()
    if not learns or told_laws:  # no cogging is looked for
        return made(model)
    return made(model, richer=made(with_cogging(model), beside=("poles",)))


def _made(
    model: Model,
    richer: Glr | None = None,
    beside: Sequence[str] = (),
    *,
    problem: Problem,
    told: Sequence[str],
    learn: Sequence[str] | str,
    track: Sequence[str],
    deviations: Mapping[str, float] | None,
    walk: float,
    noise: float | None,
    spread: float,
    commissioning: float | None,
) -> Glr:
    """Return the filter for a model, with some further parameters to learn."""
    period, torque = problem.period, problem.torque
    inverses = (f"1/{p}" for p in model.parameters if p not in model.law_parameters)
    track = names_of("track", track, (*model.parameters, *inverses, *TRACKED))
    tracked = (*problem.identify, *(n for n in track if is_left(model, n, problem.identify)))
    learnt = (*learnt_of(model, tracked, learn), *beside)
    names = (*tracked, *learnt)
    which = (*tracked, *(n for n in structure(model) if n in learnt))
    model = without(model, [n for n in ("f_s", "gap") if n not in (*names, *told)])
    sizes = state_sizes(model, torque, period)
    thought = prior(model, names, torque=torque, period=period, told=told, spread=spread)
    refuse_zero(thought)
    thought = thought if deviations is None else known_better(model, thought, deviations)
    stated = (*told, *structure(model))  # which every axis has
    fixable = fixable_of(model) if learn == "auto" else ()
    rates = np.where(np.arange(len(which)) < len(tracked), 1.0, SUSPECTED)
    states = list(model.states)
    return Glr(
        make_design(
            model,
            **problem.asked | {"identify": names, "noise": noise, "bounds": thought.bounds},
            theta0=thought.start,
            P0=thought.P0,
            scale=thought.scale,
            x0_variance=sizes**2,
            corrects=True,
        ),
        tracked=len(tracked),
        jumps=Jumps(
            which=tuple(names.index(name) for name in which),
            size=np.full(len(which), JUMP),
            rate=RATE * rates / rates.sum(),
            walk=_walk(model, names, len(tracked), walk) * period,
        ),
        timing=lengths(model, period, commissioning, deviations is not None),
        told=told_groups(model, names, learnt, stated),
        fixable={n: AS_TOLD if n in stated else AS_ABSENT for n in fixable},
        shapes=shapes_of_friction(model, names) if learn == "auto" else {},
        waves=_most_waves(model, torque, period) if richer else 0,
        angle=states.index("angle_motor") if "angle_motor" in states else len(states),
        richer=richer,
        torque_noise=_torque_noise(model, torque, period) if problem.output == "angle" else {},
    )


def _torque_noise(model: Model, torque: ArrayLike | None, period: float) -> dict[str, float]:
    """Return the state that the torque drives and its initial gain of variance per sample."""
    effect = matrices(model)[1] * period
    driven = int(np.argmax(np.abs(effect)))
    square = np.mean(np.square(1.0 if torque is None else torque))
    variance = float((TORQUE_NOISE * effect[driven]) ** 2 * square)
    return {"driven": driven, "torque_noise": variance, "first_torque_noise": variance}


def _most_waves(model: Model, torque: ArrayLike | None, period: float) -> int:
    """Return the largest number of cogging waves per turn that the filter looks for."""
    ((_, motion), *_) = measured(model, torque, period)
    return max(1, int(FASTEST / (motion.drive * period)))


def _walk(model: Model, names: Sequence[str], tracked: int, walk: float) -> np.ndarray:
    """Return the growth of the variances of θ (p,) per second, relative to the squared scale."""
    deviation = np.full(len(names), STRUCTURE / WALK * walk)
    for i, name in enumerate(names[:tracked]):
        physical = name.removeprefix("1/")
        warms = physical in model.nonnegative or physical in model.law_parameters
        deviation[i] = walk * (FRICTION if warms else 1.0)
    return deviation**2


ENTRIES = (
    Entry(
        "glr",
        "recommended: a joint Kalman filter with a bank of hypotheses, which parameter jumped, "
        "when, by how much",
        glr,
        knob="walk",
        default=WALK,
        rank=9.7,
        laws=True,
    ),
)
