"""An axis whose only law is Coulomb friction: its parts, as code that follows it takes them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.discretisation import plan
from flexaxis.estimators.models.law_torques import BRISTLE
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.models.sampled import sampled

Array = NDArray[np.float64]

COULOMB, BREAKAWAY, STIFFNESS, DAMPING, SOFTNESS = 0, 1, 3, 4, 5  # roles of bristles
STIFF = 1.0  # radians a sample: bristles that swing faster are Coulomb's friction


class _Dry(NamedTuple):
    """
    An axis with Coulomb friction at fixed parameters, as `follow` takes it.

    Attributes
    ----------
    row, column : (entries,) int arrays
        Places of the generator that are not zero.
    slides, sticks : (entries, 1+p) arrays
        The generator and its derivatives, and those of the axis that sticks.
    sliding, sticking : (1+p, n+1, n+1) arrays
        What a sample makes of a state; outputs come last.
    output : (1+p, n+1) array
        y, of the state.
    pull : (n+1,) array
        Derivative of the speed, of the state.
    speed, torque : int
        Places of the speed and of the torque of friction.
    sense : float
        Sign of that torque when the speed is positive.
    level : float
        f_c.
    lane : int
        Whose derivative is by f_c; 0 for none.
    gain : float
        Derivative of f_c by its parameter.
    cleared : (r,) int array
        States that are zero at the start of every sample.
    parts, order : int
        Of a sample, and of the series in each.
    h : float
        Length of a part [s].
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    slides: Array
    sticks: Array
    sliding: Array
    sticking: Array
    output: Array
    pull: Array
    speed: int
    torque: int
    sense: float
    level: float
    lane: int
    gain: float
    cleared: NDArray[np.int64]
    parts: int
    order: int
    h: float


def is_dry(model: Parametrization, period: float) -> bool:
    """Return whether the only law of an axis is Coulomb friction of one of its speeds.

    Bristles that swing faster than a period [s] can show, as (σ₀/J)^½ rad/s, are that.
    """
    laws = model.laws
    if laws is None or len(laws.kind) != 1 or laws.kind[0] != BRISTLE:
        return False
    force = model.blocks(model.theta)[0, : model.n, model.n - 1]
    value, parameter = laws.value[0], laws.parameter[0]
    shaped = any(value[r] or parameter[r] >= 0 for r in (BREAKAWAY, DAMPING, SOFTNESS))
    if shaped or parameter[STIFFNESS] >= 0 or np.sum(laws.drive[0] != 0) != 1:
        return False
    speed = int(np.argmax(laws.drive[0]))
    alone = np.flatnonzero(force).tolist() == [speed] and laws.drive[0, speed] == 1
    return bool(alone and np.sqrt(value[STIFFNESS] * abs(force[speed])) * period >= STIFF)


def dry(model: Parametrization, theta: Array, period: float) -> _Dry:
    """Return an axis that `is_dry` at some parameters, sampled with a period [s]."""
    n, generator, laws = model.n, model.blocks(theta), model.laws
    assert laws is not None
    speed = int(np.argmax(laws.drive[0]))
    order, parts = plan(model, theta, theta, period)
    output, stuck = generator[:, n].copy(), generator.copy()
    stuck[:, speed] = 0.0
    sliding, sticking = sampled(generator, period), sampled(stuck, period)
    generator[:, n] = 0.0
    row, column = np.nonzero(np.any(generator != 0, axis=0))
    slides = np.ascontiguousarray(generator[:, row, column].T)
    sticks = np.where((row == speed)[:, None], 0.0, slides)
    which, factor = int(laws.parameter[0, COULOMB]), float(laws.value[0, COULOMB])
    options = parts, order, period / parts
    sense = -float(np.sign(generator[0, speed, n - 1]))
    return _Dry(
        row,
        column,
        slides,
        sticks,
        sliding,
        sticking,
        output,
        generator[0, speed].copy(),
        speed,
        n - 1,
        sense,
        factor * float(theta[which]) if which >= 0 else factor,
        1 + which,
        factor,
        np.array(model.reset, np.int64),
        *options,
    )
