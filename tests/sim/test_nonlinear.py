"""Coulomb friction and backlash of the plant against solutions found without MuJoCo."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexaxis.sim.errors import ScenarioError
from flexaxis.sim.parameters import preset
from flexaxis.sim.plant import Plant
from flexaxis.sim.scenario import parse_scenario

N1 = preset("n1")
T = 0.005


def rates(x, u, *, coulomb=0.0, backlash=0.0):
    """d/dt of (x1, x2, v_m, v_g, v_a), equations of motion written out by hand."""
    q = N1
    x1, x2, vm, vg, va = x
    stretched = x1 - np.clip(x1, -backlash / 2, backlash / 2)
    gear = q.k_g * stretched + q.d_g * (q.r * vm - vg)
    arm = q.k_a * x2 + q.d_a * (vg - va)
    motor = q.k_T * u - q.f_m * vm - q.r * gear
    dry = coulomb * np.sign(vm) if vm else np.clip(motor, -coulomb, coulomb)
    return [q.r * vm - vg, vg - va, (motor - dry) / q.J_m, (gear - arm - q.f_g * vg) / q.J_g,
            (arm - q.f_a * va) / q.J_a]  # fmt: skip


def torque(N=200):
    t = np.arange(N) * T
    return 1.2 * np.sin(2 * np.pi * 3 * t) + 0.6 * np.sin(2 * np.pi * 13 * t)


def plant_speeds(u, **options):
    plant, speed = Plant([N1], substeps=20, **options), []
    for value in u:
        plant.step(np.array([value]))
        speed.append(plant.speed_m[0])
    return np.array(speed)


def test_backlash_against_an_adaptive_integrator():
    u, width = torque(), 4e-4
    x, speed = np.zeros(5), []
    for value in u:
        found = solve_ivp(lambda t, x, u=value: rates(x, u, backlash=width), (0, T), x,
                          rtol=1e-9, atol=1e-12, max_step=T / 20)  # fmt: skip
        x = found.y[:, -1]
        speed.append(x[2])
    ours = plant_speeds(u, backlash=width)
    linear = plant_speeds(u)
    # the kinks cost the fourth-order method its order: 1e-4 of the amplitude is left
    assert abs(ours - speed).max() < 1e-3 * abs(ours).max()
    assert abs(linear - speed).max() > 0.05 * abs(ours).max()


def test_coulomb_against_small_steps():
    """Reference: the velocity-level impulse of dry friction, 100 steps a sample."""
    u, level, h = torque(), 0.2, T / 100
    x, speed = np.zeros(5), []
    for value in u:
        for _ in range(100):
            free = x + h * np.array(rates(x, value))  # without dry friction
            free[2] -= np.clip(free[2], -h * level / N1.J_m, h * level / N1.J_m)
            half = (x + free) / 2  # one corrector step, for second order in all else
            new = x + h * np.array(rates(half, value))
            new[2] -= np.clip(new[2], -h * level / N1.J_m, h * level / N1.J_m)
            x = new
        speed.append(x[2])
    ours, linear = plant_speeds(u, coulomb=level), plant_speeds(u)
    # reference and plant both place the switch of the force within a step
    assert np.sqrt(np.mean((ours - speed) ** 2)) < 0.02 * ours.std()
    assert np.sqrt(np.mean((linear - speed) ** 2)) > 0.2 * ours.std()


def test_a_torque_below_coulomb_friction_moves_nothing():
    assert abs(plant_speeds(np.full(200, 0.09), coulomb=0.1)).max() < 1e-3
    assert abs(plant_speeds(np.full(200, 0.12), coulomb=0.1)).max() > 0.1


def test_absent_tables_do_not_touch_the_identity():
    text = 'name = "a"\nduration = 1.0\n'
    plain = parse_scenario(text)
    assert "friction" not in plain.resolved() and "backlash" not in plain.resolved()
    rough = parse_scenario(text + "friction.coulomb = 0.1\n")
    assert rough.hash != plain.hash
    assert parse_scenario(rough.to_toml()).hash == rough.hash


def test_misspelt_key():
    with pytest.raises(ScenarioError, match=r"known are coulomb\. Did you mean 'coulomb'"):
        parse_scenario('name = "a"\nduration = 1.0\nfriction.colomb = 0.1\n')
