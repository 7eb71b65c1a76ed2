"""Helpers of the tests of the simulation side: equations (1)-(4) and exact sampling."""

import numpy as np
import pytest
from scipy.linalg import expm

from flexaxis.sim.scenario import parse_scenario


@pytest.fixture
def make():
    """Return a scenario from TOML lines added to a short base."""

    def build(text="", **top):
        lines = "".join(f"{key} = {value}\n" for key, value in top.items())
        return parse_scenario('name = "test-v1"\n' + lines + text)

    return build


def state_space(theta):
    """A and B of equations (3) and (4), written down from the paper, not from the package."""
    kT, Jm, Jg, Ja, kg, ka, dg, da, fm, fg, fa, r = theta
    A = np.array(
        [
            [0, 0, r, -1, 0],
            [0, 0, 0, 1, -1],
            [-r * kg / Jm, 0, -(r**2 * dg + fm) / Jm, r * dg / Jm, 0],
            [kg / Jg, -ka / Jg, r * dg / Jg, -(fg + dg + da) / Jg, da / Jg],
            [0, ka / Ja, 0, da / Ja, -(da + fa) / Ja],
        ]
    )
    return A, np.array([0, 0, kT / Jm, 0, 0])


def exact_speed(torque, parameters, period):
    """Motor speed (N,) for a torque held from sample to sample, from rest; no step error.

    The physical state goes on unchanged where parameters change: an inertia keeps its speed.
    """
    x, speed, cache = np.zeros(5), np.empty(len(torque)), {}
    for k, (u, theta) in enumerate(zip(torque, parameters, strict=True)):
        speed[k] = x[2]
        key = theta.tobytes()
        if key not in cache:
            A, B = state_space(theta)
            block = np.zeros((6, 6))
            block[:5, :5], block[:5, 5] = A, B
            cache[key] = expm(block * period)
        x = (cache[key] @ np.append(x, u))[:5]
    return speed
