"""What is thought of the laws of an axis whose parameters have names of their own."""

from dataclasses import replace

import numpy as np
import pytest

from flexaxis.estimators.models.laws import Law
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.registry import REGISTRY

PERIOD = 0.005
RNG = np.random.default_rng(0)
TORQUE = np.convolve(RNG.normal(size=4000), np.ones(4) / 2, "same")

PLAY = Law(
    "spring",
    {"twist": 1.0},
    {"speed_motor": "-r*k/J_m", "speed_load": "k/J_l"},
    {"gap": "play"},
)
FRICTION = {"coulomb": "level", "beta": 10.0}
BELT = Model(
    "belt",
    states=("twist", "speed_motor", "speed_load"),
    A=[["0", "r", "-1"], ["-r*k/J_m", "-b_m/J_m", "0"], ["k/J_l", "0", "-b_l/J_l"]],
    B=["0", "gain/J_m", "0"],
    C=["0", "1", "0"],
    nominal={
        **{"gain": 1.0, "J_m": 1e-3, "J_l": 0.02, "k": 300.0, "b_m": 1e-3, "b_l": 1e-2, "r": 0.2},
        **{"play": 1e-3, "level": 0.1},
    },
    positive=("J_m", "J_l", "k"),
    nonnegative=("b_m", "b_l"),
    laws=(
        PLAY,
        Law("static", {"speed_load": 1.0}, {"speed_load": "-1/J_l"}, FRICTION),
        Law("static", {"speed_motor": 1.0}, {"speed_motor": "-1/J_m"}, FRICTION),
    ),
)


def run(model, torque, **changed):
    """Return the output of a model of whose parameters some are others."""
    there = replace(model, nominal=dict(model.nominal) | changed)
    one = there.parametrize(there.parameters[:1])
    return predict(one, one.theta, torque, period=PERIOD)[0]


@pytest.mark.slow
def test_a_belt_is_tracked():
    belt = replace(BELT, laws=BELT.laws[2:])
    make = REGISTRY["glr"].factory
    noise = 0.05 * np.random.default_rng(1).standard_normal(len(TORQUE))
    estimator = make(
        belt, PERIOD, identify=("gain", "b_m"), track=("gain", "b_m", "level"), torque=TORQUE
    )
    theta = estimator.run(TORQUE, run(belt, TORQUE, gain=1.1, level=0.13) + noise)
    found = dict(zip(estimator.names, theta[-1], strict=True))
    assert found["gain"] == pytest.approx(1.1, rel=0.02)
    assert found["level"] == pytest.approx(0.13, rel=0.1)
