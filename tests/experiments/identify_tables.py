"""Print the errors of `identify` on simulated drives with dry friction, and the coverage.

``python tests/experiments/identify_tables.py rails|loops|arms 3000 3005``: rails have friction that
no law describes, loops close over an encoder, arms hang. The numbers are the first and last seed.
The torque is computed from an encoder and held.
"""

import sys
import time

import numpy as np
from identify_axes import NAMES, VALUES, _inertia, _matrices, _multisine, _stepped
from numba import njit

from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.identify import identify
from flexaxis.sim.record import Record

FINE = 40  # steps of a sample, and of a step in which friction changes its sign
RAIL = {"k_T": 1.0, "J_m": 95.0, "f_m": 203.0}  # kg, N/(m/s): a prismatic drive
ARM = {"k_T": 1.0, "J_m": 0.01, "f_m": 0.05}
# hump over f_c and its speed; ripple, its wave number and phase; sidedness; offset; gravity
SMOOTH = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def rails(seed):
    """Yield a drive at 1 kHz that moves to and fro, with a hump, ripple and uneven friction."""
    rng, N = np.random.default_rng([7, seed]), 20_000
    low = [0.0, 0.0032, 0.5, 2 * np.pi / 0.06, 0.0, -0.3, -4.0, 0.0]
    high = [0.3, 0.0032, 2.5, 2 * np.pi / 0.01, 2 * np.pi, 0.3, 4.0, 0.0]
    path = 0.1 * np.sin(1e-3 * np.cumsum(rng.uniform(0.3, 1.5, 20).repeat(N // 20)))
    yield RAIL | {"f_c": 20.0}, 1, path, (9000.0, 1900.0), 1e-3, rng.uniform(low, high), 1e-6


def loops(seed):
    """Yield loops of one and two masses with encoders of 13 to 18 bits, rough and smooth."""
    for masses, values in VALUES.items():
        for ratio in (0, 10) if masses < 3 else ():
            for bits in (13, 16, 18):
                rng, inertia = np.random.default_rng([9, seed, masses, bits]), _inertia(values)
                reference = _multisine(20_000, 1e-3, 8.0, rng)
                truth, gains = (
                    values | {"f_c": ratio * values["f_m"]},
                    (3600 * inertia, 80 * inertia),
                )
                yield truth, masses, reference, gains, 1e-3, SMOOTH, 2 * np.pi / 2**bits


def arms(seed):
    """Yield a hanging arm with dry friction, at 500 Hz."""
    rng, N = np.random.default_rng([10, seed]), 10_000
    swing = np.sin(2 * np.pi * 0.13 * 2e-3 * np.arange(N)) * rng.uniform(0.8, 1.5)
    shape = np.r_[SMOOTH[:-1], 0.3]
    reference = swing + _multisine(N, 2e-3, 6.0, rng)
    yield ARM | {"f_c": 0.1, "g_sin": 0.3}, 1, reference, (9.0, 0.6), 2e-3, shape, 2 * np.pi / 2**16


def logged(truth, masses, reference, gains, period, shape, step):  # noqa: PLR0917
    """Return the record of a drive that follows a reference by its encoder of some step."""
    A, B, motor = _matrices(masses, truth)
    whole, fine = (_stepped(A, B, truth["k_T"], period / n) for n in (FINE, FINE**2))
    friction = truth["f_c"], truth["f_m"]
    u, angle = _driven(whole, fine, motor, reference, gains, period, friction, shape, step)
    increment = np.diff(angle, prepend=angle[0]) / period
    held = {"torque": "held", "torque_because": "as stated"}
    time = period * np.arange(len(u))
    return Record(time=time, torque=u, angle=angle, increment=increment, versions=held)


@njit
def _driven(whole, fine, motor, reference, gains, period, friction, shape, step):  # noqa: PLR0917
    N, x, memory = len(reference), np.zeros(len(whole[1])), np.exp(-period / 2e-3)
    x[-1] = reference[0]
    u, angle, slope, target, before = np.zeros(N), np.zeros(N), 0.0, reference[0], reference[0]
    for k in range(N):
        angle[k] = np.rint(x[-1] / step) * step
        slope = memory * slope + (1 - memory) * (angle[k] - before) / period
        speed, before, target = (reference[k] - target) / period, angle[k], reference[k]
        u[k] = gains[0] * (reference[k] - angle[k]) + gains[1] * (speed - slope)
        for _ in range(FINE):
            after = _step(whole, motor, x, u[k], friction, shape)
            if x[motor] * after[motor] <= 0:  # friction changes its sign
                after = x
                for _ in range(FINE):
                    after = _step(fine, motor, after, u[k], friction, shape)
            x = after
    return u, angle


@njit
def _step(system, motor, x, u, friction, shape):  # noqa: PLR0917
    hump, slow, ripple, wave, phase, sided, offset, gravity = shape
    Phi, gain, brake = system
    v, side = x[motor], 1.0 + 0.5 * sided * np.sign(x[motor])
    angle = x[-1] + 0.5 * Phi[-1, motor] * v  # in the middle of the step
    u = u + offset - ripple * np.sin(wave * angle + phase) - gravity * np.sin(angle)
    x = Phi @ x + gain * (u - friction[1] * v * (side - 1.0))  # the linear part has f_m itself
    level = friction[0] * side * (1.0 + hump * np.exp(-((v / slow) ** 2)))
    return x + brake * min(max(-x[motor] / brake[motor], -level), level)


def printed(title, truth, masses, *drive):
    """Print an identification; return its status, and the errors over their deviations."""
    begun, record = time.process_time(), logged(truth, masses, *drive)
    result = identify(record, find_axis(NAMES[masses]))
    status, z, cells = int(bool(result.warnings)), [], []
    for name, (value, sd) in result.estimates.items():
        if of := truth.get(name):
            z.append((value - of) / sd)
            cells.append(f"{name} {100 * (value / of - 1):+.2f} % (z {z[-1]:+.1f})")
    spent = time.process_time() - begun
    print(title, f"{spent:.0f} s, status {status}, {result.friction}:", *cells, flush=True)
    print(*(f"    ! {text}\n" for text in result.warnings), end="", flush=True)
    return status, np.abs(z)


def main(table, first, last):
    """Print a table."""
    rows = [
        printed(f"{table} {seed}.{i}", *drive)
        for seed in range(int(first), int(last) + 1)
        for i, drive in enumerate({"rails": rails, "loops": loops, "arms": arms}[table](seed))
    ]
    every = np.concatenate([z for _, z in rows])
    for times, expected in ((1.0, 68), (1.96, 95), (3.0, 99.7)):
        print(f"within {times} sd: {100 * np.mean(every < times):.0f} % (expected {expected} %)")
    wrong = sum(not status and z.max() > 3 for status, z in rows)
    print(f"status 0: {sum(not status for status, _ in rows)} of {len(rows)}; beyond 3 sd: {wrong}")


if __name__ == "__main__":
    main(*sys.argv[1:])
