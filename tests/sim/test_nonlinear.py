"""What the plant has beyond the linear model, against solutions found without MuJoCo."""

from functools import partial

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexaxis.sim.tables.friction import FrictionConfig, LuGreConfig
from flexaxis.sim.tables.nonlinear import (
    BacklashConfig,
    CoggingConfig,
    SaturationConfig,
    StiffeningConfig,
)

from .motion import LUGRE, N1, T, distance, rates, solved, stepped, torque


def cogging(x, u):
    return rates(N1, x, u + 0.1 * np.sin(24 * x[0]))


def stiffening(x, u, q=N1):
    return rates(q, x, u, spring=lambda twist, k: k * (twist + 3e5 * twist**3))


def saturation(x, u):
    return rates(N1, x, min(max(u, -1.0), 1.0))


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
        # the engine's bristles are of first order in the step: 7e-4 measured
        (LuGreConfig(**LUGRE), lugre, 7, 2e-3),
    ],
    ids=["cogging", "stiffening", "saturation", "LuGre"],
)
def test_against_an_adaptive_integrator(feature, rate, size, tolerance):
    u = torque()
    reference = solved(u, rate, size)
    assert distance(stepped(N1, u, feature), reference) < tolerance
    assert distance(stepped(N1, u), reference) > 0.005  # and it matters


def test_lugre_sticks_and_breaks_away():
    u = np.linspace(0.0, 0.2, 200)  # breaks away at 0.15, and then slides with 0.1
    reference, ours = solved(u, lugre, 7), stepped(N1, u, LuGreConfig(**LUGRE))
    assert abs(reference[:140]).max() < 0.05 and reference[-1] > 0.5
    # the bristles of first order are late by a part of a step when they break
    assert distance(ours, reference) < 2e-3
    level = stepped(N1, u, LuGreConfig(**LUGRE | {"static": 0.1}))
    assert distance(level, reference) > 0.1


def located(u, mode, rate, events, switch):
    """Speed after each sample of a system with modes, each switch located by root finding.

    `events(mode, u)` are functions whose roots end a mode, and `switch(mode, x, u)` the next.
    """
    x, speed = np.zeros(6), []
    for value in u:
        t, mode = 0.0, switch(mode, x, value)
        while t < T:
            watched = events(mode, value)
            for event in watched:
                event.terminal = True
            found = solve_ivp(lambda t, x, m=mode, v=value: rate(m, x, v), (t, T), x,
                              rtol=1e-9, atol=1e-13, events=watched)  # fmt: skip
            t, x = found.t[-1], found.y[:, -1]
            if found.status == 1:
                mode = switch(mode, x, value, found.t_events)
        speed.append(x[3])
    return np.array(speed)


def crossing(function, direction):
    def event(t, x):
        return function(x)

    event.direction = direction
    return event


def test_backlash_against_located_switches():
    u, width = torque(), 4e-4

    def rate(side, x, value):  # side of the gap: -1, in it: 0, +1
        def spring(twist, k):
            return k * (twist - side * width / 2) if side else 0.0

        return rates(N1, x, value, spring=spring)

    def events(side, value):
        edges = {0: ((1, 1), (-1, -1)), 1: ((1, -1),), -1: ((-1, 1),)}[side]
        return [
            crossing(lambda x, s=s: N1.r * x[0] - x[1] - s * width / 2, way) for s, way in edges
        ]

    def switch(side, x, value, hits=None):
        if hits is None:
            return side
        return 0 if side else (1 if len(hits[0]) else -1)

    reference = located(u, 0, rate, events, switch)
    # the kinks cost the fourth-order method its order: 7e-6 measured
    assert distance(stepped(N1, u, BacklashConfig(gear=width)), reference) < 5e-5
    assert distance(stepped(N1, u), reference) > 0.05


def test_coulomb_against_located_switches():
    u, level = torque(), 0.2

    def pull(x, value):  # torque on the motor that friction has to hold
        return N1.J_m * rates(N1, x, value)[3]

    def rate(way, x, value):
        found = rates(N1, x, value - way * level)
        return found if way else [0.0, *found[1:3], 0.0, *found[4:]]

    def events(way, value):
        if way:
            return [crossing(lambda x: x[3], -way)]
        return [crossing(lambda x: abs(pull(x, value)) - level, 1)]

    def switch(way, x, value, hits=None):
        if hits is None and way:
            return way  # sliding goes on when the command changes
        x[3] = 0.0
        force = pull(x, value)
        return int(np.sign(force)) if abs(force) >= level * (1 - 1e-9) else 0

    reference = located(u, 0, rate, events, switch)
    # the engine places the switch of the force within a step: of first order, 7e-4 measured
    assert distance(stepped(N1, u, FrictionConfig(coulomb=level)), reference) < 2e-3
    assert distance(stepped(N1, u), reference) > 0.2


def test_a_torque_below_coulomb_friction_moves_nothing():
    friction = FrictionConfig(coulomb=0.1)
    assert abs(stepped(N1, np.full(200, 0.09), friction)).max() < 1e-3
    assert abs(stepped(N1, np.full(200, 0.12), friction)).max() > 0.1


def test_a_fault_of_the_gear_spring_scales_all_of_its_law():
    u, weak = torque(), N1.replace(k_g=0.7 * N1.k_g)
    reference = solved(u, partial(stiffening, q=weak))
    assert distance(stepped(N1, u, StiffeningConfig(gear=3e5), fault=weak), reference) < 1e-5
