"""Laws of friction that the engine lacks, against solutions found without it."""

import numpy as np
import pytest

from flexaxis.sim.parameters import preset
from flexaxis.sim.plant.plant import Plant
from flexaxis.sim.scenario import parse_scenario
from flexaxis.sim.simulate import simulate
from flexaxis.sim.tables.friction import (
    GearFrictionConfig,
    LoadFrictionConfig,
    StaticFrictionConfig,
)

from .motion import N1, T, distance, rates, solved, stepped, torque

WG = preset("wg")
CURVE = {"f_c": 0.74302635727901, "f_s": 3.98628540790595,
         "alpha": 3.24015074090438, "beta": 0.79943497008153}  # fmt: skip


def curve(v, f_c, f_s, alpha, beta):
    return (f_c + f_s / np.cosh(alpha * v)) * np.tanh(beta * v)


def rubbed(q, u, friction):
    """Speed after each sample under a torque of friction(x) [N m]."""
    return solved(u, lambda x, value: rates(q, x, q.k_T * value - friction(x)))


KEYS = {StaticFrictionConfig: "static_friction", LoadFrictionConfig: "load_friction"}


def inline(table):
    return ", ".join(f"{name} = {value}" for name, value in table.model_dump().items())


def test_the_published_axis():
    u = torque(5.0, 400)
    reference = rubbed(WG, u, lambda x: curve(x[3], **CURVE))
    assert distance(stepped(WG, u, StaticFrictionConfig(**CURVE)), reference) < 1e-5
    assert distance(stepped(WG, u), reference) > 0.3  # and it matters


LOOP = """name = "x"
duration = 2.0
preset = "{}"
controller.Kv = {}
excitation = {{ kind = "multisine", rms = 0.05 }}
"""


@pytest.mark.parametrize(
    ("name", "Kv", "table", "law"),
    [
        ("wg", 1.08, StaticFrictionConfig(**CURVE), lambda x: curve(x[3], **CURVE)),
        ("n1", 0.22, LoadFrictionConfig(f_c=0.1, load=0.1),
         lambda x: (0.1 + 0.1 * abs(load(N1, x))) * np.tanh(x[3] / 0.1)),
    ],
    ids=["wg", "load"],
)  # fmt: skip
def test_under_the_torque_of_a_loop(name, Kv, table, law):
    """It turns the motor round within a millisecond, which is harder on the steps than a sine."""
    text = LOOP.format(name, Kv) + f"{KEYS[type(table)]} = {{ {inline(table)} }}\n"
    (record,) = simulate(parse_scenario(text), [0])
    u = record.torque[:-1]
    ours = record.true_speed[1:]
    assert np.array_equal(ours, stepped(preset(name), u, table))
    reference = rubbed(preset(name), u, law)
    assert distance(ours, reference) < 3e-4  # 6e-5 and 1.3e-4 measured over 4 s
    assert distance(stepped(preset(name), u), reference) > 0.05


def load(q, x):
    """Torque of the gear spring on the motor side."""
    return q.r * q.k_g * (q.r * x[0] - x[1])


LOAD = LoadFrictionConfig(f_c=0.03, load=0.1)


def load_friction(x):
    return (0.03 + 0.1 * abs(load(N1, x))) * np.tanh(x[3] / 0.1)


def test_friction_that_grows_with_the_load():
    u = torque()
    reference = rubbed(N1, u, load_friction)
    assert distance(stepped(N1, u, LOAD), reference) < 1e-5
    assert distance(stepped(N1, u), reference) > 0.01  # and it matters


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


def test_energy_of_a_gear_with_friction_is_balanced():
    """Work of the motor is energy kept, and what dampers and friction took."""
    q, u, small = N1, torque(), 1e-4
    plant = Plant([q], period=small, substeps=1, nonlinear=[GearFrictionConfig(**GEAR)])
    done, taken, heat = 0.0, 0.0, 0.0
    for value in np.repeat(u, round(T / small)):
        x = np.concatenate([plant.angles[0], plant.speeds[0]])
        plant.step(np.array([value]))
        y = np.concatenate([plant.angles[0], plant.speeds[0]])
        vm, vg, va = (x[3:] + y[3:]) / 2
        done += value * (y[0] - x[0])
        spring = -load(q, (x + y) / 2)
        heat += gear_friction(vm, value, spring) * (y[0] - x[0])
        losses = (q.f_m * vm**2 + q.f_g * vg**2 + q.f_a * va**2
                  + q.d_g * (q.r * vm - vg) ** 2 + q.d_a * (vg - va) ** 2)  # fmt: skip
        taken += losses * small
    kinetic = q.J_m * y[3] ** 2 + q.J_g * y[4] ** 2 + q.J_a * y[5] ** 2
    kept = (kinetic + q.k_g * (q.r * y[0] - y[1]) ** 2 + q.k_a * (y[1] - y[2]) ** 2) / 2
    assert done == pytest.approx(kept + taken + heat, rel=2e-3)
    assert heat > 0.2 * done  # and friction is a large part of it


@pytest.mark.parametrize("name", CURVE)
def test_each_parameter_of_the_curve_can_change_in_a_run(name):
    u, changed = torque(5.0), CURVE | {name: 1.5 * CURVE[name]}
    ours = stepped(WG, u, StaticFrictionConfig(**CURVE), law={0: {name: changed[name]}})
    assert np.array_equal(ours, stepped(WG, u, StaticFrictionConfig(**changed)))
    assert distance(ours, stepped(WG, u, StaticFrictionConfig(**CURVE))) > 1e-4


AS_KEYS = {"f_c": {"coulomb": 0.2, "static": 0.25}, "f_s": {"static": 0.3},
           "v_s": {"stribeck": 0.2}, "sigma_0": {"stiffness": 20.0},
           "sigma_1": {"damping": 0.6}}  # fmt: skip
VALUES = {"f_c": 0.2, "f_s": 0.2, "v_s": 0.2, "sigma_0": 20.0, "sigma_1": 0.6}
