"""Laws of friction that the engine lacks, against solutions found without it."""

import numpy as np
import pytest

from flexaxis.sim.parameters import preset
from flexaxis.sim.tables.friction import (
    GearFrictionConfig,
    LoadFrictionConfig,
    StaticFrictionConfig,
)

from .motion import N1, distance, rates, solved, stepped, torque

WG = preset("wg")
CURVE = {"f_c": 0.74302635727901, "f_s": 3.98628540790595,
         "alpha": 3.24015074090438, "beta": 0.79943497008153}  # fmt: skip


def curve(v, f_c, f_s, alpha, beta):
    return (f_c + f_s / np.cosh(alpha * v)) * np.tanh(beta * v)


def rubbed(q, u, friction):
    """Speed after each sample under a torque of friction(x) [N m]."""
    return solved(u, lambda x, value: rates(q, x, q.k_T * value - friction(x)))


def test_the_published_axis():
    u = torque(5.0, 400)
    reference = rubbed(WG, u, lambda x: curve(x[3], **CURVE))
    assert distance(stepped(WG, u, StaticFrictionConfig(**CURVE)), reference) < 1e-5
    assert distance(stepped(WG, u), reference) > 0.3  # and it matters


def load(q, x):
    """Torque of the gear spring on the motor side."""
    return q.r * q.k_g * (q.r * x[0] - x[1])


LOAD = LoadFrictionConfig(f_c=0.03, load=0.1)


def load_friction(x):
    return (0.03 + 0.1 * abs(load(N1, x))) * np.tanh(x[3] / 0.1)


def test_friction_that_grows_with_the_load_beside_a_static_one():
    u, other = torque(), {"f_c": 0.02, "f_s": 0.01, "alpha": 3.0, "beta": 8.0}
    reference = rubbed(N1, u, lambda x: load_friction(x) + curve(x[3], **other))
    assert distance(stepped(N1, u, LOAD, StaticFrictionConfig(**other)), reference) < 1e-5
    assert distance(stepped(N1, u, LOAD), reference) > 1e-3  # both matter
    assert distance(stepped(N1, u), reference) > 0.01


GEAR = {"f_c": 0.03, "f_s": 0.05, "motor": 0.2, "external": 0.05, "motor_slow": 0.1,
        "external_slow": 0.3, "v_s": 2.0, "alpha": 1.3, "smooth": 0.1}  # fmt: skip


def gear_friction(v, motor, spring):
    """Magnitude and sign of it, from its torques; the spring's is that on the motor."""
    g, left = GEAR, np.exp(-(abs(v / GEAR["v_s"]) ** GEAR["alpha"]))
    fast = g["f_c"] + abs(g["external"] * spring - g["motor"] * motor)
    slow = g["f_s"] + abs(g["external_slow"] * spring - g["motor_slow"] * motor)
    return (fast + left * slow) * np.tanh(v / g["smooth"])


@pytest.mark.parametrize("k_T", [1.0, 0.8])
def test_the_friction_of_a_gear_is_that_of_its_torques(k_T):
    """Against an adaptive method; what the motor gives is what acts, and not what is asked."""
    q, u = N1.replace(k_T=k_T), torque()

    def rate(x, value):
        friction = gear_friction(x[3], k_T * value, -load(q, x))
        return rates(q, x, k_T * value - friction)

    reference = solved(u, rate)
    ours = stepped(q, u, GearFrictionConfig(**GEAR))
    assert distance(ours, reference) < 1e-4
    for name in ("motor", "external", "motor_slow", "external_slow"):  # each of them acts
        without = stepped(q, u, GearFrictionConfig(**GEAR | {name: 0.0}))
        assert distance(without, reference) > 2e-3, name


@pytest.mark.parametrize("name", CURVE)
def test_each_parameter_of_the_curve_can_change_in_a_run(name):
    u, changed = torque(5.0), CURVE | {name: 1.5 * CURVE[name]}
    ours = stepped(WG, u, StaticFrictionConfig(**CURVE), law={0: {name: changed[name]}})
    assert np.array_equal(ours, stepped(WG, u, StaticFrictionConfig(**changed)))
    assert distance(ours, stepped(WG, u, StaticFrictionConfig(**CURVE))) > 1e-4
