"""
Drives whose friction no law describes, and loops that close over an encoder: logs of known truth.

Beside Coulomb's and viscous friction there is what rails and gears have: a hump of friction below
a twentieth of the top speed, a ripple over the position, two directions that differ, a constant
force; how much of each is drawn by the seed. The torque is computed from an encoder and held.
"""

from dataclasses import dataclass

import numpy as np
from identify_axes import VALUES, _matrices, _multisine, _stepped
from numba import njit

from flexaxis.sim.record import Record

STEPS = 20  # of a sample
FINE = 60  # the same, where an encoder of 18 bits sees friction turn over
RAIL = {"k_T": 1.0, "J_m": 95.0, "f_m": 203.0}  # kg, N/(m/s): a prismatic drive
RAIL_COULOMB = 20.0  # N


@dataclass(frozen=True)
class Troubles:
    """
    What friction has beside f_c sgn v + f_m v.

    Attributes
    ----------
    hump : float
        Friction more at rest, as a part of f_c; it falls off within a fiftieth of the top speed.
    ripple, pitch, phase : float
        Its size [as f_c], and its pitch in angle or position.
    sided : float
        By which part friction is greater in one direction than in the other.
    offset, gravity : float
        A constant force, and one that goes as the sine of the angle.
    """

    hump: float = 0.0
    ripple: float = 0.0
    pitch: float = 1.0
    phase: float = 0.0
    sided: float = 0.0
    offset: float = 0.0
    gravity: float = 0.0


def troubles(seed: int) -> Troubles:
    """Return those of a rail, drawn by a seed: up to what a published drive has."""
    rng = np.random.default_rng([7, seed])
    return Troubles(
        hump=rng.uniform(0.0, 0.3),
        ripple=rng.uniform(0.5, 2.5),
        pitch=rng.uniform(0.01, 0.06),
        phase=rng.uniform(0, 2 * np.pi),
        sided=rng.uniform(-0.3, 0.3),
        offset=rng.uniform(-4.0, 4.0),
    )


def rail(seed: int, seconds: float = 25.0, given: Troubles | None = None) -> Record:
    """Return a log of a prismatic drive at 1 kHz that moves to and fro, with rests."""
    rng = np.random.default_rng([8, seed])
    N, period = round(seconds / 1e-3), 1e-3
    reference = _strokes(N, period, rng)
    loop = (9000.0, 1900.0)  # N/m, N/(m/s)
    return _logged(
        RAIL, 1, reference, loop, period=period, f_c=RAIL_COULOMB, top=0.16,
        troubles=troubles(seed) if given is None else given, step=1e-6, noise=1e-6, rng=rng,
    )  # fmt: skip


def loop(
    masses: int, bits: int, ratio: float, seed: int, *, seconds: float = 20.0, period: float = 1e-3
) -> Record:
    """
    Return a log of one or two masses whose torque is computed from an encoder of some bits.

    Parameters
    ----------
    masses : {1, 2}
    bits : int
    ratio : float
        f_c/f_m [rad/s].
    seed : int
    """
    rng = np.random.default_rng([9, seed, masses, bits])
    values = VALUES[masses]
    reference = _multisine(round(seconds / period), period, 8.0, rng)
    inertia = values["J_m"] + values.get("J_l", 0.0)
    gains = 60.0**2 * inertia, 80.0 * inertia
    return _logged(
        values, masses, reference, gains, period=period, f_c=ratio * values["f_m"], top=30.0,
        troubles=Troubles(), step=2 * np.pi / 2**bits, noise=0.0, rng=rng, steps=FINE,
    )  # fmt: skip


def arm(seed: int, gravity: float = 0.3, seconds: float = 20.0) -> Record:
    """Return a log of a hanging arm with dry friction, at 500 Hz."""
    rng = np.random.default_rng([10, seed])
    values, period = {"k_T": 1.0, "J_m": 0.01, "f_m": 0.05}, 2e-3
    N = round(seconds / period)
    swing = np.sin(2 * np.pi * 0.13 * period * np.arange(N)) * rng.uniform(0.8, 1.5)
    reference = swing + _multisine(N, period, 6.0, rng)
    return _logged(
        values, 1, reference, (9.0, 0.6), period=period, f_c=0.1, top=20.0,
        troubles=Troubles(gravity=gravity), step=2 * np.pi / 2**16, noise=0.0, rng=rng,
    )  # fmt: skip


def _strokes(N, period, rng):
    """Return strokes to and fro at several speeds, with rests between."""
    found, at = [], 0.0
    while sum(map(len, found)) < N:
        reach, top = rng.uniform(0.05, 0.12), rng.uniform(0.03, 0.15)
        reach *= -1 if at > 0 else 1
        length = round(max(abs(reach - at) * 1.875 / top, 0.3) / period)
        s = np.arange(1, length + 1) / length
        found.append(at + (reach - at) * s**3 * (10 - 15 * s + 6 * s**2))
        found.append(np.full(round(rng.uniform(0.02, 0.15) / period), reach))
        at = reach
    return np.concatenate(found)[:N]


def _logged(
    values, masses, reference, gains, *, period, f_c, top, troubles, step, noise, rng, steps=STEPS
):
    A, B, motor = _matrices(masses, values)
    h = period / steps
    whole, fine = (_stepped(A, B, values["k_T"], part) for part in (h, h / steps))
    t = troubles
    shape = np.array(
        [f_c, values["f_m"], t.hump, top / 50, t.ripple, 2 * np.pi / t.pitch, t.phase, t.sided,
         t.offset, t.gravity, h]
    )  # fmt: skip
    seen = noise * rng.standard_normal(len(reference))
    u, angle = _driven(whole, fine, motor, reference, gains, period, shape, step, seen, steps)
    increment = np.diff(angle, prepend=angle[0]) / period
    return Record(
        time=period * np.arange(len(u)), torque=u, angle=angle, increment=increment,
        versions={"torque": "held", "torque_because": "as stated"},
    )  # fmt: skip


@njit
def _driven(whole, fine, motor, reference, gains, period, shape, step, seen, steps):  # noqa: PLR0917
    N, x = len(reference), np.zeros(len(whole[1]))
    x[-1] = reference[0]
    u, angle = np.zeros(N), np.zeros(N)
    slope, memory, target, before = 0.0, np.exp(-period / 2e-3), reference[0], reference[0]
    for k in range(N):
        measured = x[-1] + seen[k]
        if step > 0:
            measured = np.rint(measured / step) * step
        angle[k] = measured
        slope = memory * slope + (1 - memory) * (measured - before) / period
        before = measured
        wanted = (reference[k] - target) / period
        target = reference[k]
        u[k] = gains[0] * (reference[k] - measured) + gains[1] * (wanted - slope)
        for _ in range(steps):
            after = _step(whole, motor, x, u[k], shape)
            if x[motor] * after[motor] <= 0:  # friction turns over: when, matters
                after = x
                for _ in range(steps):
                    after = _step(fine, motor, after, u[k], shape)
            x = after
    return u, angle


@njit
def _step(system, motor, x, u, shape):
    Phi, gain, friction = system
    f_c, f_m, hump, slow, ripple, wave, phase, sided, offset, gravity, h = shape
    v, q = x[motor], x[-1] + 0.5 * h * x[motor]  # half way
    side = 1.0 + 0.5 * sided * np.sign(v)
    # the linear part has f_m already, alike in both directions
    acts = u + offset - ripple * np.sin(wave * q + phase) - gravity * np.sin(q)
    acts -= f_m * v * (side - 1.0)
    level = f_c * side * (1.0 + hump * np.exp(-((v / slow) ** 2)))
    x = Phi @ x + gain * acts
    return x + friction * min(max(-x[motor] / friction[motor], -level), level)
