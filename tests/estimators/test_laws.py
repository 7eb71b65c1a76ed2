"""Nonlinear laws of models: against an adaptive integrator, differences, the engine, a textbook."""

from dataclasses import replace

import numpy as np
import pytest

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axis_models import (
    BRISTLES,
    COGGING,
    GEAR_FRICTION,
    GEAR_SPRING,
    LIMIT,
    N1,
    STATIC,
    three_mass,
    with_angle,
)
from flexaxis.estimators.models.laws import Law
from flexaxis.estimators.models.simulation import along as run_along
from flexaxis.estimators.models.simulation import simulation
from flexaxis.estimators.signals import increment
from flexaxis.sim.parameters import preset
from flexaxis.sim.plant.plant import Plant
from flexaxis.sim.tables.friction import GearFrictionConfig, LuGreConfig, StaticFrictionConfig
from flexaxis.sim.tables.nonlinear import (
    BacklashConfig,
    CoggingConfig,
    SaturationConfig,
    StiffeningConfig,
)
from tests.sim.motion import distance

T = 0.005
VALUES = N1 | {
    "f_c": 0.1, "f_s": 0.05, "v_s": 0.5, "sigma_0": 100.0, "sigma_1": 0.3, "v_0": 0.05,
    "alpha": 3.24, "beta": 8.0, "kappa": 3e4, "gap": 5e-5,
    "c_sin": 0.1, "c_cos": 0.02, "poles": 24.0, "torque_limit": 1.0,
    "mu_m": 0.08, "mu_e": 0.1, "mu_ms": 0.06, "mu_es": 0.12, "sharpness": 1.6,
}  # fmt: skip
LAWS = {
    "bristle": (BRISTLES,),
    "static": (STATIC,),
    "spring": (GEAR_SPRING,),
    "sinusoid": (COGGING,),
    "clip": (LIMIT,),
    "gear": (GEAR_FRICTION, GEAR_SPRING),
    "all": (BRISTLES, GEAR_SPRING, COGGING, LIMIT),
}


def axis(name, **values):
    return replace(with_angle(three_mass(VALUES | values)), laws=LAWS[name])


def estimated(model):
    own = (n for law in model.laws for n in law.names if n != "poles")
    return ("k_T", "1/J_a", "f_m", "k_g", *own)


def torque(n=200):
    return 0.8 * np.convolve(np.random.default_rng(0).standard_normal(n), np.ones(3) / 2, "same")


def along(design, eta, u, *, steps=None):
    """Yield the simulation, and states and sensitivities (1+p, n+1) after each sample."""
    ready = simulation(design, eta, T, steps=steps)
    for value in u:
        run_along(ready, np.array([value]))
        yield ready, ready["X"][:, : 1 + len(eta)].T


def travelled(model, u, *, steps=None, theta=None):
    """States and sensitivities (N, 1+p, n+1) after each sample, in relative parameters."""
    names = estimated(model)
    one = model.parametrize(names)
    eta = np.ones(len(names)) if theta is None else theta
    return np.array([X.copy() for _, X in along(one.relative(one.theta), eta, u, steps=steps)])


def unsolved(ready):
    """What a step leaves of its equation, over the size of it."""
    law, mean, gain = ready["laws"][0], ready["lanes"][1], ready["coupling"]
    return abs(mean[0, 0] - law["offset"] - gain[0, 0, 0] * law["local"][0]) / law["reach"]


def test_the_search_ends_where_the_laws_hold():
    """Under a rough torque as well, where a step of the search may halve what is left, no more."""
    u = 0.8 * np.random.default_rng(1).standard_normal(1000)
    for name in ("static", "bristle"):
        model = axis(name, beta=8.0, sigma_0=1e4, v_0=0.0)
        one = model.parametrize(["k_T"])
        assert max(unsolved(ready) for ready, _ in along(one, one.theta, u)) < 1e-9


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("output", ["speed", "increment"])
def test_derivatives_against_differences(name, output):
    model, u = axis(name), torque(120)
    model = model if output == "speed" else increment(model, T)
    exact, p = travelled(model, u), len(estimated(model))
    for i in range(p):
        step = 3e-6 * np.eye(p)[i]
        high, low = (travelled(model, u, theta=np.ones(p) + s)[:, 0, -1] for s in (step, -step))
        slope = (high - low) / 6e-6
        assert abs(slope - exact[:, 1 + i, -1]).max() < 1e-6 * abs(slope).max(), estimated(model)[i]


ENGINE = {
    "bristle": (
        LuGreConfig(stiffness=100.0, damping=0.3, coulomb=0.1, static=0.15, stribeck=0.5),
        160, 2e-3,  # the engine's bristles are of first order: .0012 with these
    ),
    "gear": (
        GearFrictionConfig(
            f_c=0.1, f_s=0.05, motor=0.08, external=0.1, motor_slow=0.06, external_slow=0.12,
            v_s=0.5, alpha=1.6,
        ),
        40, 2e-3,  # .0003 with twice the steps of the model, where friction is steep
    ),
    "static": (StaticFrictionConfig(f_c=0.1, f_s=0.05, alpha=3.24, beta=8.0), 20, 2e-3),
    "spring": (StiffeningConfig(gear=3e4), 20, 1e-3),
    "gap": (BacklashConfig(gear=4e-4), 20, 2e-3),
    "sinusoid": (CoggingConfig(amplitude=0.1, poles=24), 5, 1e-3),
    "clip": (SaturationConfig(torque=1.0), 5, 1e-4),
}  # fmt: skip


@pytest.mark.parametrize("name", ENGINE)
def test_against_the_engine(name):
    feature, substeps, most = ENGINE[name]
    values = {"gap": 0.0, "kappa": 3e4, "c_cos": 1e-12, "v_0": 1e-9}
    values |= {"gear": {"v_0": 0.05, "kappa": 0.0}, "gap": {"gap": 4e-4, "kappa": 0.0}}.get(
        name, {}
    )
    model = axis("spring" if name == "gap" else name, **values)
    plant, u, speed = (
        Plant([preset("n1")], period=T, substeps=substeps, nonlinear=[feature]),
        torque(),
        [],
    )
    for value in u:
        plant.step(np.array([value]))
        speed.append(plant.speed_m[0])
    laws, linear = (m.parametrize(["k_T"]) for m in (model, replace(model, laws=())))
    ours, without = (
        np.array([X[0, -1] for _, X in along(one, one.theta, u, steps=steps)])
        for one, steps in ((laws, 16), (linear, None))
    )
    speed = np.array(speed)
    assert distance(ours, speed) < most
    assert not linear.forces and distance(ours, speed) < distance(without, speed) / 10


FULL = ({"speed_motor": 1.0}, {"speed_motor": "-1/J_m"}, GEAR_FRICTION.parameters)


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (("static", {"speed": 1.0}, {"speed_motor": "-1/J_m"}, {"coulomb": "f_c"}), "speed_motor"),
        (("bristle", {"speed_motor": 1.0}, {"speed_motor": "1"}, {"coulomb": "f_c"}), "stiffness"),
        (("statik", {"speed_motor": 1.0}, {"speed_motor": "1"}, {}), "static"),
        (("static", {"speed_motor": 1.0}, {"speed_motor": "1"}, {"colomb": 1.0}), "coulomb"),
        (("static", {}, {"speed_motor": "1"}, {"coulomb": 1.0}), "drive"),
        (("gear", *FULL), "the model 'three_mass' has no law 'spring'"),
        (("static", {"speed_motor": 1.0}, {"speed_motor": "sin(k)"}, {"coulomb": 1.0}), "sin"),
    ],
)  # fmt: skip
def test_a_law_that_cannot_be_is_refused(law, words):
    with pytest.raises(EstimatorError, match=words):
        replace(three_mass(VALUES), laws=(Law(*law),))
