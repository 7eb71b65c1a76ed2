"""
Take a model over a sample from the measured angle.

Where a torque depends on the angle, as cogging does, a model that integrates its own speed would
run away: on an axis that its controller holds at an angle at which cogging is unstable, the model
has no controller. So the angle of the model begins every sample where it was measured.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.laws import KINDS
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.recursion.records import Record, record
from flexaxis.estimators.sampling.compiler import compiled, inlined
from flexaxis.estimators.sampling.prepared import travel

Array = NDArray[np.float64]
SINUSOID = KINDS.index("sinusoid")


def angle_of(model: Parametrization) -> int:
    """Return which state is the angle on which a torque depends; −1 where there is none."""
    law = _sinusoid(model)
    return -1 if law is None else int(abs(law.drive[:-1]).argmax())


def measuring(model: Parametrization, *, increments: bool, period: float) -> tuple[Record, Record]:
    """
    Return tuning and state for `integrate`.

    Parameters
    ----------
    model : Parametrization
    increments : bool
        Whether y is increments of the angle.
    period : float
        Sampling period [s].
    """
    law = _sinusoid(model)
    places, factors = (np.full(2, -1), np.ones(2)) if law is None else (law.place, law.factor)
    tuning = record(
        angle=angle_of(model),
        increments=increments,
        period=period,
        poles=1.0 if law is None else law.poles,
        phase=places if (places >= 0).all() and not increments else np.full(2, -1),
        factors=factors,
    )
    return tuning, record(angle=0.0, last=0.0, turned=0.0, turning=1, u=np.zeros(2))


class _Sinusoid(NamedTuple):
    """Drive of the law; places and factors of sine and cosine among the parameters; poles."""

    drive: Array
    place: NDArray[np.int64]
    factor: Array
    poles: float


def _sinusoid(model: Parametrization) -> _Sinusoid | None:
    laws = model.laws
    if laws is None or SINUSOID not in laws.kind:
        return None
    i = list(laws.kind).index(SINUSOID)
    return _Sinusoid(laws.drive[i], laws.parameter[i, :2], laws.value[i, :2], laws.value[i, 2])


@compiled
def follow(prepared, X, moved, u):
    """
    Take states and sensitivities over one sample, as `travel` does.

    Parameters
    ----------
    prepared : Prepared
    X, moved : (rows, n+1) arrays
    u : (2,) array
        Torque held from the start of the sample on, and the motor angle there as measured.
    """
    _put_angle(prepared.laws, X, u[1])
    travel(prepared, X, moved, u[0])


@compiled
def _put_angle(laws, X, angle):
    if laws is None:
        return
    for i in range(len(laws.kind)):
        if laws.kind[i] == SINUSOID:
            for j in range(laws.drive.shape[1] - 1):
                if laws.drive[i, j] != 0.0:
                    X[0, j] = angle
                    for a in range(1, len(X)):
                        X[a, j] = 0.0


@inlined
def integrate(tuning, state, y, valid):
    """
    Keep the measured angle; its sensitivities are zero.

    Of speeds it is the sum by the trapezoidal rule, of increments the sum itself. In a gap the
    model's output stands for y. The sum of noisy speeds wanders. That shows as a turn of the phase
    of what depends on it, which is undone: the angle turns instead.
    """
    row = tuning["angle"]
    if row < 0:
        return
    if not valid:
        y = state["expected"] if np.isfinite(state["expected"]) else state["last"]
    before = y if tuning["increments"] > 0 or state["count"] == 0 else state["last"]
    if state["count"] > 0:
        state["angle"] += tuning["period"] * 0.5 * (y + before)
    state["last"] = y
    if tuning["phase"][0] >= 0 and state["turning"]:
        turn(tuning, state)
    X = state["X"]
    X[row, 0] = state["u"][1] = state["angle"]
    for a in range(1, X.shape[1]):
        X[row, a] = 0.0


@inlined
def turn(tuning, state):
    """
    Turn the angle as far as the last measurement turned a sin Nφ + b cos Nφ, and that back.

    A step along the circle is taken as one on it: straight on, steps this way and that would each
    take the amplitude up, by half their square.
    """
    i, j = tuning["phase"][0], tuning["phase"][1]
    theta, moved, factors = state["theta"], state["moved"], tuning["factors"]
    a, b = factors[0] * theta[i], factors[1] * theta[j]
    earlier, late = a - factors[0] * moved[i], b - factors[1] * moved[j]
    square = earlier**2 + late**2
    if not square > 0.0:
        return
    sine, cosine = (earlier * b - late * a) / square, (earlier * a + late * b) / square
    if not cosine > abs(sine):  # it grows from nothing
        return
    angle = sine / tuning["poles"]
    state["angle"] += angle
    state["turned"] += angle
    theta[i] = cosine * earlier / factors[0]
    theta[j] = cosine * late / factors[1]
