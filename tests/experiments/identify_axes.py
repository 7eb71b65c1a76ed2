"""
Logs of one to three masses with dry friction, by an integrator of their own; parameters may change.

The linear part is exact over steps of a fortieth of a sample, and Coulomb friction is the torque
that stops the motor in a step, or all that there is of it: neither bristles nor the sampled models
of the estimators. A step in which the motor turns is taken anew in forty: friction that turns
half a step late is an inertia that is .03 % too large, twelve standard deviations of a long log.
The motor angle is controlled, by the paper's controller.
"""

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numba import njit

from flexaxis.sim.record import Record

sys.path.insert(0, str(Path(__file__).parents[1] / "estimators"))
from acceptance.axes import held, system

VALUES = {
    1: {"k_T": 1.0, "J_m": 1e-3, "f_m": 5e-3},
    2: {"k_T": 1.0, "J_m": 4e-3, "J_l": 6e-3, "k": 60.0, "d": 0.05, "f_m": 0.02, "f_l": 0.005},
    3: {
        "k_T": 1.0, "J_m": 1.2e-3, "J_g": 7.0, "J_a": 0.8, "k_g": 1.06e5, "k_a": 8.4e3,
        "d_g": 26.0, "d_a": 1.6, "f_m": 0.05, "f_g": 0.5, "f_a": 0.1, "r": 1 / 118,
    },
}  # fmt: skip
NAMES = {1: "one_mass", 2: "two_mass", 3: "three_mass"}
STEPS = 40  # of a sample


def log(
    masses: int,
    ratio: float,
    motion: str,
    *,
    seed: int,
    seconds: float = 60.0,
    period: float = 0.002,
    noise: float = 0.05,
    offset: float = 0.0,
    change: Mapping[str, float] | None = None,
    at: float = 20.0,
) -> Record:
    """
    Return a log from rest.

    Parameters
    ----------
    masses : {1, 2, 3}
    ratio : float
        f_c/f_m [rad/s].
    motion : {"multisine", "moves"}
        A multisine of .1 to 30 Hz, or moves of .4 s and rests of .2 s; faster the more dry friction
        there is.
    seed : int
    seconds, period : float
        [s].
    noise : float
        Of the speed [rad/s].
    offset : float
        Torque that acts besides [N m].
    change : mapping of str to float, optional
        Factors of parameters, f_c among them, from `at` [s] on.
    at : float
    """
    N = round(seconds / period)
    values = VALUES[masses] | {"f_c": ratio * VALUES[masses]["f_m"]}
    then = {name: value * (change or {}).get(name, 1.0) for name, value in values.items()}
    systems = tuple(_system(masses, each, period / STEPS) for each in (values, then))
    rng = np.random.default_rng([seed, masses, round(ratio)])
    speed = float(np.clip(ratio, 5, 60))
    reference = {"multisine": _multisine, "moves": _moves}[motion](N, period, speed, rng)
    stiffness = 60 * _inertia(values)
    motor = _matrices(masses, values)[2]
    u, v, angle = _run(systems, round(at / period), motor, reference, stiffness, period, offset)
    return Record(
        time=period * np.arange(N),
        torque=u,
        speed=v + noise * rng.standard_normal(N),
        angle=angle,
    )


def _system(masses, values, h):
    """Return Φ, gain and friction of a step and of a fine one, and the level of friction."""
    A, B, _ = _matrices(masses, values)
    return *(_stepped(A, B, values["k_T"], part) for part in (h, h / STEPS)), values["f_c"]


def _inertia(q):
    """Return all that the motor moves, seen from it."""
    gear = q.get("r", 1.0) ** 2
    return q["J_m"] + gear * sum(q.get(name, 0.0) for name in ("J_l", "J_g", "J_a"))


def _stepped(A, B, k_T, h):
    """Return Φ, what a torque adds in a step, and what friction of one takes."""
    step = held(A, B, h)
    gain = step[:, -1].copy()
    return step[:, :-1].copy(), gain, -gain / k_T


def _matrices(masses, q):
    """Return A and B, the angle of the motor last, and the place of its speed."""
    if masses == 1:
        A = np.array([[-q["f_m"] / q["J_m"], 0.0], [1.0, 0.0]])
        return A, np.array([q["k_T"] / q["J_m"], 0.0]), 0
    if masses == 3:
        return *system(q), 2
    A = np.zeros((4, 4))
    A[0, 1:3] = 1.0, -1.0
    A[1] = np.array([-q["k"], -q["d"] - q["f_m"], q["d"], 0.0]) / q["J_m"]
    A[2] = np.array([q["k"], q["d"], -q["d"] - q["f_l"], 0.0]) / q["J_l"]
    A[3, 1] = 1.0
    return A, np.array([0.0, q["k_T"] / q["J_m"], 0.0, 0.0]), 1


def _multisine(N, period, speed, rng):
    samples = round(10.0 / period)
    lines = np.zeros(samples // 2 + 1, complex)
    lines[1:301] = np.exp(2j * np.pi * rng.random(300))
    one = np.fft.irfft(lines, samples)
    return np.resize(one * speed / np.std(np.gradient(one, period)), N)


def _moves(N, period, speed, rng):
    length, cycle = round(0.4 / period), round(0.6 / period)
    number, since = np.divmod(np.arange(N), cycle)
    part = np.minimum(since / length, 1.0)
    reach = 0.5 * speed
    targets = np.r_[0.0, rng.uniform(-reach, reach, number.max() + 1)]
    share = part**3 * (10 - 15 * part + 6 * part**2)
    return (1 - share) * targets[number] + share * targets[number + 1]


@njit
def _run(systems, change, motor, reference, stiffness, period, offset):  # noqa: PLR0917
    N, x = len(reference), np.zeros(len(systems[0][0][1]))
    u, v, angle = np.zeros(N), np.zeros(N), np.zeros(N)
    integral, before, slope, memory = 0.0, 0.0, 0.0, np.exp(-period / 5e-4)
    for k in range(N):
        whole, fine, f_c = systems[1] if k >= change else systems[0]
        v[k], angle[k] = x[motor], x[-1]
        error = reference[k] - x[-1]
        slope = memory * slope + (1 - memory) * (error - before) / period
        before = error
        s = 4.0 * error + slope
        integral += period * 2.0 * s
        u[k] = stiffness * (s + integral)
        for _ in range(STEPS):
            after = _step(whole, motor, x, u[k] + offset, f_c)
            if x[motor] * after[motor] <= 0:
                after = x
                for _ in range(STEPS):
                    after = _step(fine, motor, after, u[k] + offset, f_c)
            x = after
    return u, v, angle


@njit
def _step(system, motor, x, torque, f_c):
    Phi, gain, friction = system
    x = Phi @ x + gain * torque
    stopping = -x[motor] / friction[motor]
    return x + friction * min(max(stopping, -f_c), f_c)
