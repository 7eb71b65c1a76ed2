"""
The paper's method on an axis with friction: it tracks what changes, and learns the rest once.

Cogging is not among what it learns: the angle that drives it is a sum of speeds, which nothing
corrects in a predictor by output error, and its sensitivities grow without end.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.filters.design import above_zero, forgetting_factor
from flexaxis.estimators.filters.prediction_error import CALM, ROBUST
from flexaxis.estimators.methods.rpem import Rpem
from flexaxis.estimators.models.laws import LAWS
from flexaxis.estimators.models.meaning import dry_friction
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.offline.sizes import measured
from flexaxis.estimators.offline.structure import (
    Prior,
    prior,
    structure_names,
    told_of,
    with_laws,
)
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import Entry

NOISE = 0.04  # of the rms speed, σ that P(0) reckons with where none is told: with less than what
# an axis is off its model before that is learnt, the first steps are too long
SPREAD = 0.05  # standard deviation of θ(0), relative to it: a new axis is about as it was designed
SETTLE = 2.0  # s: twice the memory of what is tracked
WALK = 0.01  # 1/√s, of θ/θ(0): the memory is then about a second where σ is 2 % of the speed
CEILING = 10 * CALM  # of R̂ P, relative to θ(0)²: a deviation of 10 %, twice that of the start


def _rpem_friction(
    problem: Problem,
    *,
    forgetting: float | None = None,
    robust: float = ROBUST,
    ceiling: float = CEILING,
) -> Rpem:
    """
    Make the method with a forgetting factor, on a model with dry friction and play.

    It tracks what is identified and the level f_c of dry friction; the structure of the axis is
    learnt once, from what is known of any axis (`flexaxis.estimators.offline.structure`).

    Parameters
    ----------
    P0
        Taken as by every entry, and left: P(0) is that of the priors.
    torque : (N,) array_like, optional
        Of a run in which the axis moves [N m], for the sizes of friction and play.
    forgetting : float, optional
        λ of a sample, for what is tracked.
    robust, ceiling
        As for `Rpem`.
    """
    weight = forgetting_factor(forgetting, problem.period)
    return _made(problem, forgetting=weight, robust=robust, ceiling=ceiling)


def _rpem_friction_drift(
    problem: Problem,
    *,
    walk: float = WALK,
    robust: float = ROBUST,
    ceiling: float = CEILING,
) -> Rpem:
    """
    Make the method with covariance modification, on a model with dry friction and play.

    Parameters
    ----------
    P0, torque, noise, robust, ceiling
        As for `_rpem_friction`.
    walk : float
        Standard deviation of the random walk of what is tracked after a second, relative to θ(0).
    """
    above_zero("walk", walk, "the standard deviation of θ after a second, relative to θ(0)")
    return _made(problem, walk=walk, robust=robust, ceiling=ceiling)


def _made(
    problem: Problem,
    *,
    forgetting: float | None = None,
    walk: float = 0.0,
    robust: float,
    ceiling: float,
) -> Rpem:
    model, tracked, learn, known = _known(problem)
    variance = _variance(model, problem)
    walked = problem.period * (walk * known.scale[: len(tracked)]) ** 2 / variance
    return Rpem(
        model,
        **problem.asked | {"identify": tracked, "bounds": known.bounds},
        learn=learn,
        theta0=known.start,
        P0=known.P0 / variance,
        scale=known.scale,
        settle=SETTLE,
        forgetting=forgetting,
        drift=walked if forgetting is None else None,
        state_correction=True,
        robust=robust,
        ceiling=ceiling,
    )


def _known(problem: Problem) -> tuple[Model, tuple[str, ...], tuple[str, ...], Prior]:
    """Return the model, what is tracked and what is learnt of it, and what is known of both."""
    nominal = problem.nominal
    moved: dict[str, Any] = {"torque": problem.torque, "period": problem.period}
    if not isinstance(nominal, Model):
        nominal = {name: value for name, value in nominal.items() if name != "poles"}
    model = with_laws(nominal, **moved)
    dry = [name for name in dry_friction(model) if name not in problem.identify]
    tracked = (*problem.identify, *dry)
    learn = structure_names(model, tracked)
    told = told_of(nominal)
    known = prior(model, (*tracked, *learn), **moved, told=told, spread=SPREAD)
    return model, tracked, learn, known


def _variance(model: Model, problem: Problem) -> float:
    """Return σ² that P(0) reckons with."""
    torque, period = problem.torque, problem.period
    if problem.noise is not None:
        return problem.noise**2
    if torque is None:
        stored = measured(model, None, period)  # refuses an axis that is not the nominal one
        speed = max((sizes.drive for law, sizes in stored if LAWS[law.kind].rubs), default=0.0)
    else:
        linear = replace(model, laws=())
        one = linear.parametrize(linear.parameters[:1])
        speed = float(np.std(predict(one, one.theta, torque, period=period)[0]))
    if not speed > 0:
        raise EstimatorError(
            "how large the noise of y may be is known only of an axis that moves: give the torque "
            "of a run, or noise, its standard deviation"
        )
    return (NOISE * speed) ** 2


ENTRIES = (
    Entry(
        "rpem-friction",
        "the paper's method with a forgetting factor, on a model with dry friction and play",
        _rpem_friction,
        knob="1-forgetting",
        default=0.995,
        rank=5.2,
        laws=True,
    ),
    Entry(
        "rpem-friction-drift",
        "the paper's method with covariance modification, on a model with dry friction and play",
        _rpem_friction_drift,
        knob="walk",
        default=WALK,
        rank=5.4,
        laws=True,
    ),
)
