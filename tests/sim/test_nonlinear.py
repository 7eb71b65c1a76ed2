"""What the plant has beyond the linear model, against solutions found without MuJoCo."""

from functools import partial

import numpy as np
import pytest

from flexaxis.sim.tables.friction import FrictionConfig, LuGreConfig
from flexaxis.sim.tables.nonlinear import (
    BacklashConfig,
    CoggingConfig,
    SaturationConfig,
    StiffeningConfig,
)

from .motion import LUGRE, N1, distance, rates, solved, stepped, torque


def cogging(x, u):
    return rates(N1, x, u + 0.1 * np.sin(24 * x[0]))


def stiffening(x, u, q=N1):
    return rates(q, x, u, spring=lambda twist, k: k * (twist + 3e5 * twist**3))


def saturation(x, u):
    return rates(N1, x, min(max(u, -1.0), 1.0))


WIDTH, LEVEL = 4e-4, 0.2


def backlash(x, u):
    def spring(twist, k):
        return k * np.sign(twist) * max(abs(twist) - WIDTH / 2, 0.0)

    return rates(N1, x, u, spring=spring)


def coulomb(x, u):
    return rates(N1, x, u - LEVEL * np.tanh(x[3] / 1e-3))  # creeps where the engine sticks


def lugre(x, u):
    s0, s1, coulomb, static, stribeck = LUGRE.values()
    v, z = x[3], x[6]
    g = coulomb + (static - coulomb) * np.exp(-((v / stribeck) ** 2))
    bend = v - s0 * abs(v) * z / g
    return [*rates(N1, x, u - s0 * z - s1 * bend), bend]


@pytest.mark.parametrize(
    ("feature", "rate", "size", "tolerance"),
    [
        # smooth in the state: the fourth-order method keeps its order, 1e-6 measured
        (CoggingConfig(amplitude=0.1, poles=24), cogging, 6, 1e-5),
        (StiffeningConfig(gear=3e5), stiffening, 6, 1e-5),
        (SaturationConfig(torque=1.0), saturation, 6, 1e-5),
        # kinks cost the method its order
        (BacklashConfig(gear=WIDTH), backlash, 6, 5e-5),
        # the engine places a switch of the force within a step: of first order
        (FrictionConfig(coulomb=LEVEL), coulomb, 6, 2e-3),
        # the engine's bristles are of first order in the step: 7e-4 measured
        (LuGreConfig(**LUGRE), lugre, 7, 2e-3),
    ],
    ids=["cogging", "stiffening", "saturation", "backlash", "Coulomb", "LuGre"],
)
def test_against_an_adaptive_integrator(feature, rate, size, tolerance):
    u = torque()
    reference = solved(u, rate, size)
    assert distance(stepped(N1, u, feature), reference) < tolerance
    assert distance(stepped(N1, u), reference) > 0.005  # and it matters


def test_a_fault_of_the_gear_spring_scales_all_of_its_law():
    u, weak = torque(), N1.replace(k_g=0.7 * N1.k_g)
    reference = solved(u, partial(stiffening, q=weak))
    assert distance(stepped(N1, u, StiffeningConfig(gear=3e5), fault=weak), reference) < 1e-5
