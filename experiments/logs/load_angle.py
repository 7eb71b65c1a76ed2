"""The angle of a load, from that of its motor and the model between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.model import Model, increment
from flexaxis.estimators.offline.predictor import predict
from flexaxis.experiments.logs.axis_file import Axis, usable
from flexaxis.sim.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Load:
    """Load angle from motor angle and model, and the hidden encoder it is compared with.

    Attributes
    ----------
    predicted, measured : ndarray (N,)
        [rad].
    fit : float
        100 (1 − |measured − predicted|/|measured − mean|).
    """

    predicted: Array
    measured: Array
    fit: float


def load_side(model: Model) -> Model | None:
    """Return the rest of a model when its motor speed is given: from motor speed to load speed.

    Row and column of the motor are taken out; what it did to the others becomes the input. None
    if there are no states ``speed_motor`` and ``speed_load`` or ``speed_arm``.
    """
    states = list(model.states)
    load = next((name for name in ("speed_load", "speed_arm") if name in states), None)
    if load is None or "speed_motor" not in states:
        return None
    motor = states.index("speed_motor")
    rest = [i for i in range(len(states)) if i != motor]
    return Model(
        name=f"{model.name}, load side",
        states=[states[i] for i in rest],
        A=[[model.A[i][j] for j in rest] for i in rest],
        B=[model.A[i][motor] for i in rest],
        C=["1" if states[i] == load else "0" for i in rest],
        nominal=model.nominal,
    )


def predicted_load(record: Record, axis: Axis, estimates: dict[str, float]) -> Load | None:
    """Predict the load angle from the measured motor angle by the estimated model, if it has one.

    Parameters
    ----------
    record : Record
        With the angle of its load, and increments of its motor.
    axis : Axis
    estimates : dict of str to float
        Of parameters, or their inverses, that stand in for nominal values.
    """
    side = load_side(axis.model)
    if side is None or record.true_angle_a is None or record.increment is None:
        return None
    physical = {
        name.removeprefix("1/"): 1 / value if name.startswith("1/") else value
        for name, value in estimates.items()
    }
    side = replace(side, nominal=dict(axis.model.nominal) | physical)
    chosen = increment(side, record.period).parametrize(side.parameters[:1])
    # the increment up to t_{k+1} is the mean motor speed over the sample from t_k on
    moved = np.append(record.increment[1:], record.increment[-1])
    speed, _ = predict(chosen, chosen.theta, moved, period=record.period)
    predicted, ok = np.cumsum(speed) * record.period, usable(record)
    predicted += np.mean((record.true_angle_a - predicted)[ok])
    error = (record.true_angle_a - predicted)[ok]
    fit = 100 * float(1 - np.std(error) / np.std(record.true_angle_a[ok]))
    return Load(predicted, record.true_angle_a, fit)
