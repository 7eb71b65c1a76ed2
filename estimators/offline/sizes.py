"""How far what drives the laws of a model moves: by a torque and the linear model, or measured."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axes import N1, three_mass
from flexaxis.estimators.models.formula import multiply_out
from flexaxis.estimators.models.known import is_axis
from flexaxis.estimators.models.laws import INPUT, Law
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.predictor import respond
from flexaxis.estimators.sampling.extended import discretize

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sizes:
    """
    How far what drives a law moves, rms.

    Attributes
    ----------
    drive : float
        Of what drives it: a speed, a twist, an angle or a torque.
    force : float
        Torque of the law that would move its state as the rms input does.
    rate : float
        Of the derivative of the drive, over the drive, or of the fastest mode of the model if that
        is faster [1/s].
    """

    drive: float
    force: float
    rate: float


NOMINAL: Mapping[str, Sizes] = {
    "bristle": Sizes(drive=5.0, force=0.85, rate=176.0),
    "spring": Sizes(drive=7.5e-4, force=9.4e-4, rate=146.0),
    "sinusoid": Sizes(drive=0.0424, force=0.85, rate=118.0),
    "clip": Sizes(drive=0.85, force=0.85, rate=0.0),
}
"""By kind of law, of the nominal axis on its reference."""


NOMINAL_STATES = {
    "twist_gear": 7.5e-4,
    "twist_arm": 2.2e-3,
    "speed_motor": 5.0,
    "speed_gear": 0.09,
    "speed_arm": 0.22,
}
"""By state, likewise."""


def measured(model: Model, torque: ArrayLike | None, period: float) -> list[tuple[Law, Sizes]]:
    """
    Return the laws of a model with their sizes.

    Parameters
    ----------
    model : Model
    torque : (N,) array_like or None
        Of a run in which the axis moves [N m]; None stands for the reference of the nominal axis.
    period : float
        Sampling period [s].

    Raises
    ------
    EstimatorError
        If the torque cannot be used, or there is none and this is not the nominal axis.
    """
    if torque is None:
        return [(law, _stored(model, law)) for law in model.laws]
    u = np.ascontiguousarray(torque, float)
    if u.ndim != 1 or not len(u) or not np.all(np.isfinite(u)) or not u.any():
        raise EstimatorError(
            "torque must be that of a run in which the axis moves: (N,) finite values, not all 0"
        )
    return [(law, _sizes(model, law, (*_linear(model), period), u)) for law in model.laws]


def _linear(model: Model) -> tuple[Array, Array]:
    """Return A (n, n) and B (n,) of a model without its laws."""
    linear = replace(model, laws=())
    one = linear.parametrize(linear.parameters[:1])
    A, B, _ = one.matrices(one.theta)
    return A, B[:, 0]


class Motion(NamedTuple):
    """
    How large a measured motion is.

    Attributes
    ----------
    torque, speed : float
        Root mean square of the torque [N m] and of the motor speed [rad/s].
    angle : float
        Standard deviation of the motor angle [rad].
    """

    torque: float
    speed: float
    angle: float


def motion(u: Array, speed: Array, period: float) -> Motion:
    """Return how large the motion of a stretch is, from torque and motor speed (N,)."""
    angle = period * np.cumsum(speed)
    torque, moves = (float(np.sqrt(np.mean(x**2))) for x in (u, speed))
    return Motion(torque, moves, float(np.std(angle)))


def natural_motion(model: Model) -> Motion:
    """
    Return a motion by a hundredth of a unit of angle at the pace of the axis.

    A linear model does not say how large its motion is, so this depends on units. Parameters of
    laws are divided by it, and nothing else: no law acts until a motion is measured.
    """
    A, B = _linear(model)
    pace = float(max(abs(np.linalg.eigvals(A))))
    return Motion(0.01 * pace**2 / float(max(abs(B))), 0.01 * pace, 0.01)


def moved(model: Model, moves: Motion) -> list[tuple[Law, Sizes]]:
    """
    Return the laws of an axis with their sizes, from how it moves rather than how it would.

    The gear twists as a torque at rest twists it; what else drives a law, or how fast contacts
    are, the linear model says.
    """
    A, B = _linear(model)
    fastest = float(max(abs(np.linalg.eigvals(A))))
    stiffness = abs(model.nominal.get("r", 1.0)) * model.nominal.get("k_g", 1.0)
    drives = {
        "speed_motor": moves.speed,
        "angle_motor": moves.angle,
        "twist_gear": abs(model.nominal["k_T"]) * moves.torque / stiffness,
        INPUT: moves.torque,
    }
    rate = max(moves.speed / moves.angle if moves.angle > 0 else 0.0, fastest)
    found = []
    for law in model.laws:
        drive = next((drives[name] for name in law.drive if name in drives), moves.speed)
        found.append((law, Sizes(drive, _force(model, law, B) * moves.torque, rate)))
    return found


def state_sizes(model: Model, torque: ArrayLike | None, period: float) -> Array:
    """
    Return how far the states (n,) of a model move, rms, as `measured`; zero for angles.

    An angle counts from where it starts.
    """
    if torque is None:
        return np.array([NOMINAL_STATES.get(state, 0.0) for state in model.states])
    A, B = _linear(model)
    transition, gain = discretize(A, B[:, None], period)
    u = np.ascontiguousarray(torque, float)
    moved = np.std(respond(transition.copy(), gain[:, 0].copy(), np.eye(len(A)), u), axis=0)
    integrates = ~np.any(A, axis=0)  # on which nothing depends
    return np.where(integrates, 0.0, moved)


def _sizes(model: Model, law: Law, linear: tuple[Array, Array, float], u: Array) -> Sizes:
    A, B, period = linear
    drive = np.array([law.drive.get(state, 0.0) for state in model.states])
    transition, gain = discretize(A, B[:, None], period)
    rows = np.array([drive, drive @ A])
    w, change = respond(transition.copy(), gain[:, 0].copy(), rows, u).T
    driven = float(np.std(w + law.drive.get(INPUT, 0.0) * u))
    force = _force(model, law, B) * float(np.sqrt(np.mean(u**2)))
    if not driven > 0:
        raise EstimatorError(f"the torque does not move {', '.join(law.drive)}, that drives a law")
    changes = float(np.sqrt(np.mean((change + (drive @ B) * u) ** 2))) / driven
    fastest = float(max(abs(np.linalg.eigvals(A))))  # a slow reference says nothing of contacts
    return Sizes(driven, force, max(changes, fastest))


def _force(model: Model, law: Law, B: Array) -> float:
    """Return the torque of a law that moves its state as an input of one does."""
    for state, formula in law.acts.items():
        i = list(model.states).index(state)
        factor = sum(
            c * float(np.prod([model.nominal[name] ** e for name, e in powers.items()]))
            for c, powers in multiply_out(formula)
        )
        if B[i] and factor:
            return abs(float(B[i]) / factor)
    return 1.0


def _stored(model: Model, law: Law) -> Sizes:
    """Return the sizes of the nominal axis on its reference, if the model is that."""
    linear = three_mass(model.nominal) if set(N1) <= set(model.nominal) else None
    if linear is None or tuple(model.states[: len(linear.states)]) != tuple(linear.states):
        known = False
    else:
        known = is_axis(linear, "n1", [p for p in linear.parameters if p != "r"])
    if not known or law.kind not in NOMINAL:
        raise EstimatorError(
            "how large friction, play and cogging can be is known only of the nominal axis; for "
            "another one give torque, that of some tens of seconds in which it moves"
        )
    return NOMINAL[law.kind]
