"""Helpers of the tests of the simulation side: equations (1)-(4) and exact sampling."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from flexaxis.sim.parameters import PARAMETER_NAMES
from flexaxis.sim.scenario import parse_scenario

sys.path.insert(0, str(Path(__file__).parents[1] / "estimators"))
from acceptance.axes import held, system


@pytest.fixture
def make():
    """Return a scenario from TOML lines added to a short base."""

    def build(text="", **top):
        lines = "".join(f"{key} = {value}\n" for key, value in top.items())
        return parse_scenario('name = "test-v1"\n' + lines + text)

    return build


def state_space(theta):
    """A (5, 5) and B (5,) of equations (3) and (4), from the paper, not from the package."""
    A, B = system(dict(zip(PARAMETER_NAMES, theta, strict=True)))
    return A[:5, :5], B[:5]


def exact_speed(torque, parameters, period):
    """Motor speed (N,) for a torque held from sample to sample, from rest; no step error.

    The physical state goes on unchanged where parameters change: an inertia keeps its speed.
    """
    x, speed, cache = np.zeros(5), np.empty(len(torque)), {}
    for k, (u, theta) in enumerate(zip(torque, parameters, strict=True)):
        speed[k] = x[2]
        key = theta.tobytes()
        if key not in cache:
            cache[key] = held(*state_space(theta), period)
        x = cache[key] @ np.append(x, u)
    return speed


def commanded(errors, period, *, Kp=4.0, Kv=0.22, Ki=2.0, tau=0.0005):
    """Yield the torque of the textbook loop for errors of the angle, one after the other."""
    a = math.exp(-period / tau) if tau else 0.0
    before = speed = integral = 0.0
    for error in errors:
        speed = a * speed + (1 - a) * (error - before) / period
        before = error
        wanted = Kp * error + speed
        integral += period * Ki * wanted
        yield Kv * (wanted + integral)
