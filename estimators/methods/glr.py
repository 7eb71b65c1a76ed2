"""Construction of the estimator glr from an estimation problem and options."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from flexaxis.estimators.filters.constrained import told_arrays
from flexaxis.estimators.filters.design import Design, above_zero, make_design
from flexaxis.estimators.filters.joint import joint_arrays
from flexaxis.estimators.glr.bank_arrays import Timing, bank_of, lengths
from flexaxis.estimators.glr.cogging import FASTEST
from flexaxis.estimators.glr.filter import Glr
from flexaxis.estimators.glr.workspace import Workspace
from flexaxis.estimators.models.axis_models import with_cogging
from flexaxis.estimators.models.memory import Memory
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parameter_meaning import fixable, shapes_of_friction, structure
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
    Prior,
    measured,
    prior,
    state_sizes,
    told_of,
    with_laws,
)
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry

WALK = 7e-4  # 1/√s, random walk of θ relative to its scale: 2 % in a quarter of an hour
FRICTION = 4.5  # walk of friction relative to `WALK`, because friction warms up: 2.4 % in a minute
STRUCTURE = 3e-4  # 1/√s, walk of parameters that are learnt once, to correct the initial errors
RATE = 1e-3  # 1/s, total rate of jumps over all parameters: about one in a quarter of an hour
SUSPECTED = 0.1  # rate of jumps of parameters that are learnt once, relative to tracked parameters
SPREAD = 0.2  # initial standard deviation of tracked parameters, relative to θ(0)


def glr(
    problem: Problem,
    *,
    learn: Sequence[str] | str = "auto",
    track: Sequence[str] = TRACKED,
    deviations: Mapping[str, float] | None = None,
    walk: float = WALK,
    spread: float = SPREAD,
    commissioning: float | None = None,
) -> Glr:
    """
    Return the estimator glr, a Kalman filter with a bank of jump hypotheses.

    All time spans in the filter are multiples of one axis time scale, as computed by
    `flexaxis.estimators.glr.bank_arrays.lengths`.

    Parameters
    ----------
    problem : Problem
        Estimation problem, either with nominal parameter values or with a model that has its own
        friction and spring laws. The nominal values should include ``poles``, ``torque_limit`` and
        ``noise`` if the data sheet states them, and ``gear_friction`` = 1 if friction grows with
        the gear load. The torque of the problem determines the prior magnitudes of friction and
        backlash. The filter computes P(0) from the prior of each parameter.
    learn : "auto", "none" or sequence of str
        Parameters that the filter learns only once. If springs, dampers or the motor inertia are
        learnt only once, the hypothesis bank also tests jumps of these parameters. If ``learn`` is
        "auto", the filter learns all parameters that the initialisation data excite, and fixes all
        others at their nominal values. `Glr.fixed_because` gives the reason for each fixed
        parameter.
    track : sequence of str
        Names of tracked parameters in addition to ``identify``.
    deviations : mapping of str to float, optional
        Prior standard deviations of physical parameters, in the units of the parameters. If
        ``deviations`` is given, the default of ``commissioning`` is zero.
    walk : float
        Standard deviation of each tracked parameter's random walk after one second, relative to the
        parameter scale. For friction parameters, the standard deviation of the random walk is 4.5
        times as large.
    spread : float
        Initial standard deviation of the tracked parameters, relative to the parameter values.
    commissioning : float, optional
        Duration of motion that the initialisation needs [s]; ten axis time scales by default.

    Raises
    ------
    EstimatorError
        If an option is invalid.
    """
    nominal, period = problem.nominal, problem.period
    above_zero("walk", walk, "the standard deviation of the random walk")
    above_zero("spread", spread, "the initial standard deviation")
    model = with_laws(nominal, torque=problem.torque, period=period)
    inverses = (f"1/{p}" for p in model.parameters if p not in model.law_parameters)
    track = names_of("track", track, (*model.parameters, *inverses, *TRACKED))
    tracked = (*problem.identify, *(n for n in track if is_left(model, n, problem.identify)))
    learnt, auto = learnt_of(model, tracked, learn), learn == "auto"
    work = partial(
        _work,
        problem=problem,
        tracked=tracked,
        timing=lengths(model, period, commissioning, deviations is not None),
        deviations=deviations,
        walk=walk,
        spread=spread,
        auto=auto,
    )
    told_laws = isinstance(nominal, Model) or {"mu_m", "poles"} & model.nominal.keys()
    if not auto or deviations is not None or commissioning == 0 or told_laws:
        return Glr(work(model, learnt))
    rich = work(with_cogging(model), (*learnt, "c_sin", "c_cos", "poles"))
    return Glr(work(model, learnt, looks=True), rich)


def _work(
    model: Model,
    learnt: Sequence[str],
    *,
    problem: Problem,
    tracked: Sequence[str],
    timing: Timing,
    deviations: Mapping[str, float] | None,
    walk: float,
    spread: float,
    auto: bool,
    looks: bool = False,
) -> Workspace:
    """Return the filter memory; if ``looks`` is True, the filter searches for cogging."""
    period, torque = problem.period, problem.torque
    told, names = told_of(problem.nominal), (*tracked, *learnt)
    model = without(model, [n for n in ("f_s", "gap") if n not in (*names, *told)])
    thought = prior(model, names, torque=torque, period=period, told=told, spread=spread)
    refuse_zero(thought)
    thought = thought if deviations is None else known_better(model, thought, deviations)
    design = _design(model, problem, thought, _walk(model, names, len(tracked), walk))
    scale, at = thought.scale, {name: i for i, name in enumerate(names)}
    stated = (*told, *structure(model))  # present in every axis
    groups = [
        {at[n]: value / scale[at[n]] for n, value in group.items()}
        for group in told_groups(model, names, learnt, stated)
    ]
    which = (*tracked, *(n for n in structure(model) if n in learnt))
    rates = np.where(np.arange(len(which)) < len(tracked), 1.0, SUSPECTED)
    states = Memory(joint_arrays(design, rests=True, **problem.torque_noise(model)), times=2)
    bank = bank_of(
        design,
        timing,
        which=[at[name] for name in which],
        log_prior=np.log(RATE * rates / rates.sum() * period),
        told=told_arrays(len(tracked), [(list(g), list(g.values())) for g in groups]),
        waves=_most_waves(model, torque, period) if looks else 0,
    )
    shapes = shapes_of_friction(model, names) if auto else {}
    return Workspace(
        design=design,
        timing=timing,
        tracked=len(tracked),
        told={i: value for group in groups for i, value in group.items()},
        fixable={
            at[n]: AS_TOLD if n in stated else AS_ABSENT
            for n in fixable(model)
            if auto and n in learnt
        },
        shapes=[([at[n] for n in of], [at[n] for n in shape]) for of, shape in shapes.items()],
        angle=len(model.states),
        states=states,
        bank=bank,
        begin=states,
    )


def _design(model: Model, problem: Problem, thought: Prior, walk: np.ndarray) -> Design:
    """Return the filter design for a prior and the random walk computed by `_walk`."""
    noise = problem.noise
    if noise is None and not isinstance(problem.nominal, Model):
        noise = problem.nominal.get("noise")
    return make_design(
        model,
        **problem.asked | {"identify": thought.names, "noise": noise, "bounds": thought.bounds},
        theta0=thought.start,
        P0=thought.P0,
        scale=thought.scale,
        drift=walk * problem.period * thought.scale**2,
        x0_variance=state_sizes(model, problem.torque, problem.period) ** 2,
        corrects=True,
    )


def _most_waves(model: Model, torque: ArrayLike | None, period: float) -> int:
    """Return the largest number of waves per revolution that the cogging search tests."""
    ((_, motion), *_) = measured(model, torque, period)
    return max(1, int(FASTEST / (motion.drive * period)))


def _walk(model: Model, names: Sequence[str], tracked: int, walk: float) -> np.ndarray:
    """Return the random walk variances after one second, relative to the squared scales (p,)."""
    deviation = np.full(len(names), STRUCTURE / WALK * walk)
    for i, name in enumerate(names[:tracked]):
        physical = name.removeprefix("1/")
        warms = physical in model.nonnegative or physical in model.law_parameters
        deviation[i] = walk * (FRICTION if warms else 1.0)
    return deviation**2


ENTRIES = (
    Entry(
        "glr",
        "recommended estimator: a joint Kalman filter that tests which parameter jumped, when, "
        "and by how much",
        glr,
        knob="walk",
        default=WALK,
        rank=9.7,
        laws=True,
    ),
)
