"""
Simulation of an axis with Coulomb friction, in which the times of friction reversals are exact.

Between two friction reversals, an axis with Coulomb friction is linear. While the axis slides,
friction is a constant torque. While the axis sticks, the speed is zero. The simulation halves a
step that contains a reversal until the reversal time is known to 2⁻⁴⁰ of a sampling period.
Estimates therefore do not depend on a step size, and the sum of squared residuals is a smooth
function of the parameters.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.compiler import compiled, inlined
from flexaxis.estimators.models.law_torques import BRISTLE
from flexaxis.estimators.models.parametrization import Parametrization

Array = NDArray[np.float64]

COULOMB, STIFFNESS = 0, 3  # indices of two roles of the bristle law
STIFF = 1.0  # radians per sample: bristles that vibrate faster are treated as Coulomb friction
HALVINGS = 40  # largest number of halvings of a sample


class Sampled(NamedTuple):
    """
    A sampled axis with fixed parameters, which the function `follow` simulates.

    The last state is the motor torque, and the second to last state is the friction torque.

    Attributes
    ----------
    moves : (2, parts, n+1, n+1) array
        Transition matrices over the times T, T/2, T/4, … for a sliding axis and for a sticking
        axis.
    output : (n+1,) array
        Row of coefficients that maps the states to the output y.
    pull : (n+1,) array
        Row of coefficients that maps the states to the acceleration of the friction contact,
        multiplied by T.
    speed : int
        Index of the state that is the speed of the friction contact.
    level : float
        Coulomb friction f_c, or 0 for an axis without dry friction.
    cleared : (r,) int array
        Indices of the states that are set to zero at the start of every sample.
    """

    moves: Array
    output: Array
    pull: Array
    speed: int
    level: float
    cleared: NDArray[np.int64]


def is_dry(model: Parametrization, period: float) -> bool:
    """
    Return whether the only nonlinear torque of an axis is Coulomb friction on one speed state.

    The model represents Coulomb friction as a bristle law with a Coulomb friction torque, a
    stiffness and no other parameters. The natural frequency (σ₀/J)^½ [rad/s] of the bristles must
    be so high that their vibration is not visible at the sampling period [s].
    """
    if model.laws["kind"].tolist() != [BRISTLE]:
        return False
    law, force = model.laws[0], model.blocks(model.theta)[0, :, model.n - 1]
    alone = np.flatnonzero(force).tolist() == np.flatnonzero(model.drive).tolist()
    simple = {*np.flatnonzero(law["value"])} <= {COULOMB, STIFFNESS}
    swing = np.sqrt(law["value"][STIFFNESS] * abs(force).max()) * period
    return bool(simple and alone and np.count_nonzero(force) == 1 and swing >= STIFF)


def sampled(model: Parametrization, theta: Array, period: float) -> Sampled:
    """Return the sampled axis for parameters θ (p,); the axis must be linear or pass `is_dry`."""
    generator, level, speed = model.blocks(theta)[0] * period, 0.0, 0
    output, generator[-1] = generator[-1] / period, 0.0
    stuck = generator.copy()
    if model.forces:
        law, speed = model.laws[0], int(np.argmax(model.drive))
        level = float(law["value"][COULOMB] * np.append(theta, 1.0)[law["parameter"][COULOMB]])
        stuck[speed] = 0.0
    cleared = np.array(model.reset, np.int64)
    short = np.array([generator, stuck]) * 0.5**HALVINGS
    less = [short + short @ short / 2]  # exp(G) − I, accurate to round-off
    for _ in range(HALVINGS):
        less.append(2 * less[-1] + less[-1] @ less[-1])
    moves = np.eye(len(stuck)) + np.stack(less[::-1], axis=1)
    return Sampled(moves, output, generator[speed].copy(), speed, level, cleared)


@inlined
def _times(row, x):
    """Return the scalar product of a coefficient row and a state vector."""
    total = 0.0
    for j in range(len(x)):
        total += row[j] * x[j]
    return total


@compiled
def follow(axis, x, torque):
    """
    Simulate N samples; return the output (N,) after each sample, and update the state x.

    Parameters
    ----------
    axis : Sampled
    x : (n+1,) array
        State before the first sample, which is overwritten with the state after the last sample.
    torque : (N,) array
        Motor torque in each sample; the torque is constant over a sample.
    """
    v, after = axis.speed, np.zeros(len(x))
    hold = abs(axis.pull[-2] * axis.level)
    y, way = np.zeros(len(torque)), np.sign(x[v]) if hold > 0.0 else 1.0
    x[-2] += axis.level * way
    for k in range(len(torque)):
        x[axis.cleared] = 0.0
        x[-1] = torque[k]
        if way == 0.0:
            way = _way(axis, x, hold)
        place = part = 0
        while place < 1 << HALVINGS:
            steps = axis.moves[int(way == 0.0), part]
            for i in range(len(x)):
                after[i] = _times(steps[i], x)
            met = hold > 0.0 and _meets(axis, x, after, way, hold, part)
            if met and part < HALVINGS:
                part += 1
                continue
            x[:] = after
            place += 1 << (HALVINGS - part)
            if met:
                x[v], way = 0.0, _way(axis, x, hold)
            while part and place % (2 << (HALVINGS - part)) == 0:
                part -= 1  # use the longest step that fits a grid through the current position
        y[k] = _times(axis.output, x)
    return y


@inlined
def _way(axis, x, hold):
    """Return the sliding direction of an axis at rest, or 0 if it sticks; update the friction."""
    x[-2] = 0.0
    pull = _times(axis.pull, x)
    way = np.sign(pull) if abs(pull) > hold else 0.0
    x[-2] = axis.level * way
    return way


@inlined
def _meets(axis, x, after, way, hold, part):  # noqa: PLR0917
    """Return whether the axis breaks away or its speed reaches zero within a step."""
    end = _times(axis.pull, after)
    if way == 0.0:
        return abs(end) > hold
    first, end, h = way * _times(axis.pull, x), way * end, 1.0 / (1 << part)
    before, now = way * x[axis.speed], way * after[axis.speed]
    return now <= 0.0 or (first < 0.0 < end and min(before + first * h, now - end * h) < 0.0)
