"""The axis in motion without MuJoCo, by an adaptive method, and the plant beside it."""

import mujoco
import numpy as np
from scipy.integrate import solve_ivp

from flexaxis.sim.parameters import preset
from flexaxis.sim.plant.plant import Plant

N1 = preset("n1")
T = 0.005
LUGRE = {"stiffness": 100.0, "damping": 0.3, "coulomb": 0.1, "static": 0.15, "stribeck": 0.5}


def torque(scale=1.0, N=200):
    t = np.arange(N) * T
    return scale * (1.2 * np.sin(2 * np.pi * 3 * t) + 0.6 * np.sin(2 * np.pi * 13 * t))


def rates(q, x, motor, spring=lambda twist, k: k * twist):
    """d/dt of (φ_m, φ_g, φ_a, v_m, v_g, v_a), equations of motion written out by hand.

    `motor` is the torque on the motor beside viscous friction and gear, `spring` the gear's law.
    """
    m, g, a, vm, vg, va = x[:6]
    gear = spring(q.r * m - g, q.k_g) + q.d_g * (q.r * vm - vg)
    arm = q.k_a * (g - a) + q.d_a * (vg - va)
    return [vm, vg, va, (motor - q.f_m * vm - q.r * gear) / q.J_m,
            (gear - arm - q.f_g * vg) / q.J_g, (arm - q.f_a * va) / q.J_a]  # fmt: skip


def solved(u, rate, size=6):
    """Speed after each sample of x' = rate(x, u), by an adaptive method with tight tolerance."""
    x, speed = np.zeros(size), []
    for value in u:
        found = solve_ivp(
            lambda t, x, value: rate(x, value), (0, T), x, "LSODA", args=(value,),
            rtol=1e-10, atol=1e-13,
        )  # fmt: skip
        x = found.y[:, -1]
        speed.append(x[3])
    return np.array(speed)


def stepped(q, u, *features, substeps=None, law=None, fault=None):
    """Speed of the plant after each sample, with the steps that a scenario would take."""
    substeps = substeps or max([5, *(feature.substeps for feature in features)])
    plant, speed = Plant([q], period=T, substeps=substeps, nonlinear=features), []
    if fault is not None:
        plant.set_parameters([fault])
    for k, value in enumerate(u):
        for name, changed in (law or {}).get(k, {}).items():
            plant.set_law(name, changed)
        plant.step(np.array([value]))
        speed.append(plant.speed_m[0])
    return np.array(speed)


def linearised(q, name="three_mass"):
    """A and B of twists and speeds, from the accelerations of the plant in unit states."""
    model = Plant([q], period=T, substeps=5, model=name)._batch.get_model(0)
    data, n = mujoco.MjData(model), model.nv
    mujoco.mj_forward(model, data)
    lengths = np.zeros((model.ntendon, n))
    mujoco.mju_sparse2dense(
        lengths, data.ten_J.ravel(), model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
    )
    angles = np.linalg.pinv(lengths)

    def rate(x, u):
        data.qpos[:], data.qvel[:], data.ctrl[:] = angles @ x[:-n], x[-n:], u
        mujoco.mj_forward(model, data)
        return np.array([*data.ten_velocity, *data.qacc])

    unit = np.eye(2 * n - 1)
    A = np.column_stack([rate(e, 0.0) for e in unit])
    return A, rate(0.0 * unit[0], 1.0)


def distance(ours, reference):
    """Rms of the difference over that of the reference."""
    return np.sqrt(np.mean((ours - reference) ** 2) / np.mean(reference**2))
