"""How far what drives the laws of a model moves: by a torque and the linear model, or measured."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axes import N1, three_mass
from flexaxis.estimators.models.discretisation import discretize
from flexaxis.estimators.models.formula import multiply_out
from flexaxis.estimators.models.laws import INPUT, LAWS, Law
from flexaxis.estimators.models.meaning import is_axis
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.predictor import as_torque, respond

Array = NDArray[np.float64]

SETTLED = 5000  # times of the fastest mode, after which the others have shown how large they are


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
    name: Sizes(*kind.nominal) for name, kind in LAWS.items() if kind.nominal
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
    u = as_torque(torque)
    if not np.all(np.isfinite(u)) or not u.any():
        raise EstimatorError("torque must be that of a run in which the axis moves, not all 0")
    A, B, _ = _matrices(model)
    fastest = float(max(abs(np.linalg.eigvals(A))))  # a slow reference says nothing of contacts
    found = []
    for law in model.laws:
        drive = np.array([law.drive.get(state, 0.0) for state in model.states])
        w, change = _respond(model, B, np.array([drive, drive @ A]), u, period)
        size = float(np.std(w + law.drive.get(INPUT, 0.0) * u))
        if not size > 0:
            given = ", ".join(law.drive)
            raise EstimatorError(f"the torque does not move {given}, that drives a law")
        rate = float(np.sqrt(np.mean((change + (drive @ B) * u) ** 2))) / size
        force = _force(model, law, B) * float(np.sqrt(np.mean(u**2)))
        found.append((law, Sizes(size, force, max(rate, fastest))))
    return found


def _matrices(model: Model) -> tuple[Array, Array, Array]:
    """Return A (n, n), B (n,) and C (n,) of a model without its laws, its output as a speed."""
    linear = replace(model, laws=())
    one = linear.parametrize(linear.parameters[:1])
    A, B, C = one.matrices(one.theta)
    return A, B[:, 0], C[0] / np.abs(C).sum()


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


def moved(model: Model, moves: Motion) -> list[tuple[Law, Sizes]]:
    """
    Return the laws of an axis with their sizes, from how it moves rather than how it would.

    Parameters
    ----------
    model : Model
        With laws that its output drives, such as friction of the motor.
    moves : Motion
    """
    A, B, _ = _matrices(model)
    fastest = float(max(abs(np.linalg.eigvals(A))))  # as fast as contacts are
    rate = max(moves.speed / moves.angle if moves.angle > 0 else 0.0, fastest)
    return [
        (law, Sizes(moves.speed, _force(model, law, B) * moves.torque, rate)) for law in model.laws
    ]


def _impulse(model: Model) -> tuple[Array, float]:
    """Return an impulse (N,) and its period [s]: it moves all modes, and lets all but creep end."""
    A, _, _ = _matrices(model)
    return np.eye(1, SETTLED)[0], 1.0 / float(max(abs(np.linalg.eigvals(A))))


def _respond(model: Model, B: Array, rows: Array, u: Array, period: float) -> Array:
    """Return rows @ x (m, N) of the linear model, driven by u (N,) through B (n,), from rest."""
    transition, gain = discretize(_matrices(model)[0], B[:, None], period)
    return respond(transition.copy(), gain[:, 0].copy(), rows, u).T


def state_sizes(model: Model, torque: ArrayLike | None, period: float) -> Array:
    """
    Return how far the states (n,) of a model move, rms, as `measured`; zero for angles.

    An angle counts from where it starts.
    """
    if torque is None:
        return np.array([NOMINAL_STATES.get(state, 0.0) for state in model.states])
    A, B, _ = _matrices(model)
    moved = np.std(_respond(model, B, np.eye(len(A)), as_torque(torque), period), axis=1)
    integrates = ~np.any(A, axis=0)  # on which nothing depends
    return np.where(integrates, 0.0, moved)


def _force(model: Model, law: Law, B: Array) -> float:
    """
    Return the torque of a law that moves its state as an input of one does.

    Where the input does not act on any of its states, such as friction of a load: that moves the
    output so.
    """
    acts = _acts(model, law)
    for i in (list(model.states).index(state) for state in law.acts):
        if B[i] and acts[i]:
            return abs(float(B[i] / acts[i]))
    u, period = _impulse(model)
    output = _matrices(model)[2][None]
    ours, theirs = (np.std(_respond(model, b, output, u, period)) for b in (acts, B))
    return float(theirs / ours) if ours > 0 and theirs > 0 else 1.0


def _acts(model: Model, law: Law) -> Array:
    """Return by what (n,) the torque of a law enters the derivatives of the states."""
    acts = np.zeros(len(model.states))
    for state, formula in law.acts.items():
        acts[list(model.states).index(state)] = sum(
            c * float(np.prod([model.nominal[name] ** e for name, e in powers.items()]))
            for c, powers in multiply_out(formula)
        )
    return acts


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
