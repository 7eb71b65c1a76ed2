"""
An axis with Coulomb friction along a torque, with each reversal at the instant at which it happens.

Between its events such an axis is linear: it slides, and friction is a constant torque, or it
sticks, and the speed is zero. A step that meets an event is halved until the event lies in a part
of 2⁻⁴⁰ of a sample, so that estimates do not depend on a step, and the sum of squares is smooth.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.compiler import compiled, inlined
from flexaxis.estimators.models.law_torques import BRISTLE
from flexaxis.estimators.models.parametrization import Parametrization

Array = NDArray[np.float64]

COULOMB, STIFFNESS = 0, 3  # roles of bristles
STIFF = 1.0  # radians a sample: bristles that swing faster are Coulomb friction
HALVINGS = 40  # of a sample, at most
ORDER, SQUARINGS = 18, 4  # of the series of a step, and how often its result is squared


class Sampled(NamedTuple):
    """
    An axis at fixed parameters, as `follow` takes it. The last of its states is the torque, held.

    Attributes
    ----------
    slides, sticks : (parts, n+1, n+1) arrays
        Transitions over T, T/2, T/4, … of an axis that slides, and of one that sticks.
    output : (n+1,) array
        y, of the states.
    acceleration : (n+1,) array
        Derivative of the speed, of the states.
    speed, friction : int
        Places of the speed and of the torque of friction among the states.
    level : float
        f_c, with the sign by which it acts on that place; 0 for an axis without friction.
    cleared : (r,) int array
        States that are zero at the start of every sample.
    period : float
        T [s].
    """

    slides: Array
    sticks: Array
    output: Array
    acceleration: Array
    speed: int
    friction: int
    level: float
    cleared: NDArray[np.int64]
    period: float


def is_dry(model: Parametrization, period: float) -> bool:
    """Return whether the only law of an axis is Coulomb friction of one of its speeds.

    Bristles that swing faster than a period [s] can show, as (σ₀/J)^½ rad/s, are that.
    """
    laws = model.laws
    if len(laws.records) != 1 or laws.records["kind"][0] != BRISTLE:
        return False
    force = model.blocks(model.theta)[0, : model.n, model.n - 1]
    value, parameter = laws.records["value"][0], laws.records["parameter"][0]
    others = [r for r in range(len(value)) if r not in {COULOMB, STIFFNESS}]
    if value[others].any() or (np.delete(parameter, COULOMB) >= 0).any():
        return False
    speed = int(np.argmax(laws.drive[0]))
    alone = np.flatnonzero(force).tolist() == [speed] and np.sum(laws.drive[0] != 0) == 1
    return bool(alone and np.sqrt(value[STIFFNESS] * abs(force[speed])) * period >= STIFF)


def sampled(model: Parametrization, theta: Array, period: float) -> Sampled:
    """Return an axis that is linear, or `is_dry`, at parameters θ (p,), sampled with a period."""
    n, (generator, *_) = model.n, model.blocks(theta)
    output, laws, level, speed = generator[n].copy(), model.laws, 0.0, 0
    generator[n] = 0.0
    parts = np.ones(1)
    stuck = generator.copy()
    if len(laws.records):
        speed, parts = int(np.argmax(laws.drive[0])), 0.5 ** np.arange(HALVINGS + 1.0)
        stuck[speed] = 0.0
        place = laws.records["parameter"][0, COULOMB]
        level = laws.records["value"][0, COULOMB] * (theta[place] if place >= 0 else 1.0)
        level *= -np.sign(generator[speed, n - 1])
    slides, sticks = (_transitions(one, period * parts) for one in (generator, stuck))
    cleared = np.array(model.reset, np.int64)
    return Sampled(
        slides, sticks, output, generator[speed].copy(), speed, n - 1, float(level), cleared, period
    )


def _transitions(generator: Array, times: Array) -> Array:
    """Return exp(G t) (times, n, n) for a generator (n, n) and times [s]."""
    small = generator * (times / 2**SQUARINGS)[:, None, None]
    term = result = np.broadcast_to(np.eye(len(generator)), small.shape)
    for k in range(1, ORDER + 1):
        term = term @ small / k
        result = result + term
    for _ in range(SQUARINGS):
        result = result @ result
    return result


@inlined
def _times(row, x):
    """Return the product of a row and a state."""
    total = 0.0
    for j in range(len(x)):
        total += row[j] * x[j]
    return total


@compiled
def follow(axis, x, torque):
    """
    Return the output (N,) after each of N torques; the state x (n+1,) goes along.

    Parameters
    ----------
    axis : Sampled
    x : (n+1,) array
    torque : (N,) array
    """
    v, whole, after = axis.speed, 1 << (len(axis.slides) - 1), np.zeros(len(x))
    hold = abs(axis.acceleration[axis.friction] * axis.level)
    y, way = np.zeros(len(torque)), np.sign(x[v])
    for k in range(len(torque)):
        for i in axis.cleared:
            x[i] = 0.0
        x[-1] = torque[k]
        if axis.level != 0.0:
            way = _way(axis, x, way, hold)
        place = 0
        while place < whole:
            part, size = 0, whole if place == 0 else place & -place
            while whole >> part > size:
                part += 1
            while True:
                steps = axis.slides[part] if way != 0.0 or hold == 0.0 else axis.sticks[part]
                for i in range(len(x)):
                    after[i] = _times(steps[i], x)
                met = hold > 0.0 and _meets(axis, x, after, way, hold, part)
                if not met or part == len(axis.slides) - 1:
                    break
                part += 1
            x[:] = after
            place += whole >> part
            if met:
                x[v], way = 0.0, _way(axis, x, 0.0, hold)
        y[k] = _times(axis.output, x)
    return y


@inlined
def _way(axis, x, way, hold):
    """Return which way an axis slides from here on, 0 if it sticks; write its friction into x."""
    x[axis.friction] = 0.0
    pull = _times(axis.acceleration, x)
    if way == 0.0 and abs(pull) > hold:
        way = np.sign(pull)
    x[axis.friction] = axis.level * way
    return way


@inlined
def _meets(axis, x, after, way, hold, part):  # noqa: PLR0917
    """Return whether a step meets an event: friction gives way, or the speed may reach zero."""
    last = _times(axis.acceleration, after)
    if way == 0.0:
        return abs(last) > hold
    before, now, h = way * x[axis.speed], way * after[axis.speed], axis.period / (1 << part)
    first, last = way * _times(axis.acceleration, x), way * last
    dips = first < 0.0 < last and min(before + first * h, now - last * h) < 0.0
    return now <= 0.0 or (dips and part < len(axis.slides) - 1)
