"""`relocate` in the registry."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.entry import Entry
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.methods.start import Nominal, factor, forgetting_P, model_of
from flexaxis.estimators.models.axes import PAPER, three_mass
from flexaxis.estimators.models.meaning import DATA_SHEET, dry_friction, named
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.sizes import natural_motion
from flexaxis.estimators.offline.structure import structure_names, told_of, with_laws
from flexaxis.estimators.recursion.design import as_numbers
from flexaxis.estimators.relocate.explain import SPREAD
from flexaxis.estimators.relocate.filter import Relocate

WALK = 1e-3  # 1/√s, of θ/θ(0)


def relocate(
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str] = PAPER,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    forgetting: float | None = None,
    alarm: float = 10.0,
    gain: float = 14.0,
    noise: float | None = None,
    deadline: float | None = None,
) -> Relocate:
    """
    Make the filter that detects, rewinds and refits; every parameter that can change is a suspect.

    Parameters
    ----------
    forgetting : float, optional
        λ of a sample.
    alarm, gain : float
        Evidence at which the residual is looked into, and that a change needs [nats].
    noise : float, optional
        Standard deviation of y, in its unit; estimated from the residual by default.
    deadline : float, optional
        Time that a sample may take [s], by operations that are counted; what an alarm asks for is
        spread over the following samples. All at once by default.
    """
    model = model_of(nominal)
    weight = factor("relocate", forgetting, model, period, identify)
    return Relocate(
        model,
        identify=identify,
        suspects=[name for name in model.parameters if name not in model.fixed],
        P0=forgetting_P(
            P0, torque, model, identify, period=period, forgetting=weight, output=output
        ),
        period=period,
        forgetting=weight,
        alarm=alarm,
        gain=gain,
        output=output,
        noise=noise,
        deadline=deadline,
    )


def relocate_friction(
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str] = PAPER,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    walk: float = WALK,
    alarm: float = 10.0,
    gain: float = 14.0,
    noise: float | None = None,
    deadline: float | None = None,
) -> Relocate:
    """
    Make the filter that rewinds and refits, on a real axis: with friction and what it has besides.

    Tracked are what is identified and dry friction; structure, of the axis and of its friction, is
    learnt once, in the first four seconds of motion, of which no alarm is raised. What is told of
    laws is where they begin; told of all of them, a second does. Parameters of laws that are
    identified come behind the others.

    Parameters
    ----------
    walk : float
        Standard deviation by which what is tracked may have changed after a second, relative.
    alarm, gain, noise, deadline
        As for `relocate`.
    """
    model = _with_laws(nominal, period)
    given = [name for name in identify if name not in model.law_parameters]
    theta = _start(model, given)
    track = tuple(dict.fromkeys([*_laws_of(model, identify, given), *dry_friction(model)]))
    known = {name.removeprefix("1/") for name in given} | set(model.fixed)
    return Relocate(
        model,
        identify=given,
        suspects=[n for n in model.parameters if n not in (*known, *model.law_parameters)],
        track=track,
        learn=structure_names(model, (*given, *track)),
        told=told_of(nominal),
        P0=(SPREAD * theta) ** 2 if P0 is None else _of(P0, identify, given),
        period=period,
        walk=walk,
        alarm=alarm,
        gain=gain,
        output=output,
        noise=noise,
        deadline=deadline,
    )


def _with_laws(nominal: Nominal, period: float) -> Model:
    """Return the axis with its laws, in sizes that hold until a motion is measured."""
    if isinstance(nominal, Model):
        return nominal
    return with_laws(nominal, period=period, motion=natural_motion(three_mass(nominal)))


def _start(model: Model, identify: Sequence[str]) -> NDArray[np.float64]:
    """Return θ(0); changes are relative to it, so none may be zero."""
    theta = model.parametrize(identify).theta
    for name, value in zip(identify, theta, strict=True):
        if not value:
            raise EstimatorError(
                f"{name} = 0 gives its changes no scale: give the size that it may have, or do not "
                "identify it"
            )
    return theta


def _laws_of(model: Model, identify: Sequence[str], given: Sequence[str]) -> list[str]:
    """Return the parameters of laws that are identified."""
    asked = [name for name in identify if name not in given]
    names = dict.fromkeys(name for law in model.laws for name in law.names)
    allowed = [name for name in names if name not in named(model.laws, DATA_SHEET)]
    for name in asked:
        if name not in allowed:
            raise EstimatorError(
                f"relocate-friction cannot track {name!r}; of laws it can track "
                + ", ".join(allowed)
            )
    return asked


def _of(P0: ArrayLike, identify: Sequence[str], given: Sequence[str]) -> ArrayLike:
    """Return the part of P(0) of those parameters that are given one; laws have a prior."""
    whole, mine = as_numbers("P0", P0), [list(identify).index(name) for name in given]
    if len(given) == len(identify) or len(whole) != len(identify):
        return P0
    return whole[mine] if whole.ndim == 1 else whole[np.ix_(mine, mine)]


ENTRIES = (
    Entry(
        "relocate",
        "detects a jump, rewinds to it and refits whichever physical parameter explains it",
        relocate,
        knob="1-forgetting",
        default=0.995,
        rank=30,
    ),
    Entry(
        "relocate-friction",
        "relocate on an axis with dry friction, play, cogging: learns these once, tracks f_c",
        relocate_friction,
        knob="walk",
        default=WALK,
        rank=31,
        laws=True,
    ),
)
