"""Logs of one and two masses with Coulomb friction, of which a parameter changes on the way.

By the integrator of `identify_axes`, which knows neither bristles nor sampled models: from some
sample on with the matrices of other values.
"""

import numpy as np
from identify_axes import NAMES, STEPS, VALUES, _matrices, _moves, _multisine
from numba import njit
from scipy.linalg import expm

from flexaxis.sim.record import Record

__all__ = ["NAMES", "VALUES", "changing_log"]


def changing_log(
    masses,
    ratio,
    motion,
    *,
    seed,
    seconds=40.0,
    period=0.002,
    noise=0.05,
    change=None,
    at=20.0,
):
    """Return a log from rest.

    Parameters
    ----------
    masses, ratio, motion, seed, seconds, period, noise
        As of `identify_axes.log`; the dry friction is `ratio` times the f_m at the start.
    change : mapping of str to float, optional
        Factors of parameters from `at` [s] on.
    at : float
        [s].
    """
    first, N = VALUES[masses], round(seconds / period)
    f_c, speed = ratio * first["f_m"], float(np.clip(ratio, 5, 60))
    then = {name: value * (change or {}).get(name, 1.0) for name, value in first.items()}
    then_f_c = f_c * (change or {}).get("f_c", 1.0)
    rng = np.random.default_rng([seed, masses, round(ratio)])
    reference = {"multisine": _multisine, "moves": _moves}[motion](N, period, speed, rng)
    stiffness = 60 * sum(value for name, value in first.items() if name.startswith("J"))
    systems = tuple(_system(masses, values, period / STEPS) for values in (first, then))
    motor = _matrices(masses, first)[2]
    u, v, angle = _run(systems, motor, reference, (stiffness, period), ((f_c, then_f_c), at))
    noisy = v + noise * rng.standard_normal(N)
    return Record(time=period * np.arange(N), torque=u, speed=noisy, angle=angle)


def _system(masses, values, h):
    """Return Φ, and the columns of the torque and of the friction, over a step."""
    A, B, _ = _matrices(masses, values)
    n = len(A)
    step = expm(np.block([[A, B[:, None]], [np.zeros((1, n + 1))]]) * h)
    gain = step[:n, n].copy()
    return step[:n, :n].copy(), gain, -gain / values["k_T"]


@njit
def _run(systems, motor, reference, gains, change):
    (stiffness, period), (levels, at), N, x = (
        gains,
        change,
        len(reference),
        np.zeros(len(systems[0][1])),
    )
    u, v, angle = np.zeros(N), np.zeros(N), np.zeros(N)
    integral, before, slope, memory = 0.0, 0.0, 0.0, np.exp(-period / 5e-4)
    for k in range(N):
        late = k >= round(at / period)
        Phi, gain, friction = systems[1] if late else systems[0]
        f_c = levels[1] if late else levels[0]
        v[k], angle[k] = x[motor], x[-1]
        error = reference[k] - x[-1]
        slope = memory * slope + (1 - memory) * (error - before) / period
        before = error
        s = 4.0 * error + slope
        integral += period * 2.0 * s
        u[k] = stiffness * (s + integral)
        for _ in range(STEPS):
            x = Phi @ x + gain * u[k]
            stopping = -x[motor] / friction[motor]
            x = x + friction * min(max(stopping, -f_c), f_c)
    return u, v, angle
