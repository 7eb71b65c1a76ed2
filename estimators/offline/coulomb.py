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
    pull : (n+1,) array
        Change of the speed in a sample by its derivative, of the states.
    speed : int
        Place of the speed among the states; the torque of friction is the last but one.
    level : float
        f_c; 0 for an axis without friction.
    cleared : (r,) int array
        States that are zero at the start of every sample.
    """

    slides: Array
    sticks: Array
    output: Array
    pull: Array
    speed: int
    level: float
    cleared: NDArray[np.int64]


def is_dry(model: Parametrization, period: float) -> bool:
    """Return whether the only law of an axis is Coulomb friction of one of its speeds.

    Bristles that swing faster than a period [s] can show, as (σ₀/J)^½ rad/s, are that.
    """
    laws, n = model.laws, model.n
    if laws.records["kind"].tolist() != [BRISTLE]:
        return False
    (drive,), (value,), (parameter,) = laws.drive, laws.records["value"], laws.records["parameter"]
    force, (speed, *more) = model.blocks(model.theta)[0, :n, n - 1], np.flatnonzero(drive)
    shaped = (
        np.delete(value, [COULOMB, STIFFNESS]).any() or (np.delete(parameter, COULOMB) >= 0).any()
    )
    alone = np.flatnonzero(force).tolist() == [speed] and force[speed] < 0 and not more
    stiffness = np.sqrt(value[STIFFNESS] * abs(force[speed])) * period
    return bool(alone and not shaped and stiffness >= STIFF)


def sampled(model: Parametrization, theta: Array, period: float) -> Sampled:
    """Return an axis that is linear, or `is_dry`, at parameters θ (p,), sampled with a period."""
    generator, laws, level, speed = model.blocks(theta)[0] * period, model.laws, 0.0, 0
    output, generator[-1], parts = generator[-1] / period, 0.0, 1
    stuck = generator.copy()
    if len(laws.records):
        speed, parts = int(np.argmax(laws.drive[0])), HALVINGS + 1
        stuck[speed] = 0.0
        place = laws.records["parameter"][0, COULOMB]
        level = laws.records["value"][0, COULOMB] * (theta[place] if place >= 0 else 1.0)
    slides = _transitions(generator, parts)
    sticks = _transitions(stuck, parts) if level else slides
    cleared = np.array(model.reset, np.int64)
    return Sampled(slides, sticks, output, generator[speed].copy(), speed, float(level), cleared)


def _transitions(generator: Array, parts: int) -> Array:
    """Return exp(G), exp(G/2), exp(G/4), … (parts, n, n) for a generator (n, n)."""
    small = generator * 0.5 ** (SQUARINGS + np.arange(parts))[:, None, None]
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
    v, last, after = axis.speed, len(axis.slides) - 1, np.zeros(len(x))
    hold = abs(axis.pull[-2] * axis.level)
    y, way = np.zeros(len(torque)), np.sign(x[v])
    x[-2] += axis.level * way
    for k in range(len(torque)):
        for i in axis.cleared:
            x[i] = 0.0
        x[-1] = torque[k]
        if hold > 0.0 and way == 0.0:
            way = _way(axis, x, hold)
        place = 0
        while place < 1 << last:
            part = 0  # of the longest step that ends where one of its length does
            while place & ((1 << (last - part)) - 1):
                part += 1
            met = True
            while met:
                steps = axis.sticks[part] if way == 0.0 and hold > 0.0 else axis.slides[part]
                for i in range(len(x)):
                    after[i] = _times(steps[i], x)
                met = hold > 0.0 and _meets(axis, x, after, way, hold, part)
                if part == last:
                    break
                part += met
            x[:] = after
            place += 1 << (last - part)
            if met:
                x[v], way = 0.0, _way(axis, x, hold)
        y[k] = _times(axis.output, x)
    return y


@inlined
def _way(axis, x, hold):
    """Return which way an axis at rest slides, 0 if it sticks; write its friction into x."""
    x[-2] = 0.0
    pull = _times(axis.pull, x)
    way = np.sign(pull) if abs(pull) > hold else 0.0
    x[-2] = axis.level * way
    return way


@inlined
def _meets(axis, x, after, way, hold, part):  # noqa: PLR0917
    """Return whether a step meets an event: friction gives way, or the speed may reach zero."""
    end = _times(axis.pull, after)
    if way == 0.0:
        return abs(end) > hold
    first, end, h = way * _times(axis.pull, x), way * end, 1.0 / (1 << part)
    before, now = way * x[axis.speed], way * after[axis.speed]
    dips = first < 0.0 < end and min(before + first * h, now - end * h) < 0.0
    return now <= 0.0 or (dips and part < len(axis.slides) - 1)
