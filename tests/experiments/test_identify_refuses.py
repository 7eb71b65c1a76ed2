"""Delays and starts that cannot be, and fits that went astray, are said."""

import numpy as np
import pytest

from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.identify import _check_rate, identify
from flexaxis.sim.record import Record

T, N, STEPS = 0.004, 2500, 40
TWO = {"k_T": 1.0, "J_m": 0.01, "J_l": 0.02, "k": 300.0, "d": 0.1, "f_m": 0.05, "f_l": 0.02}
ONE = {"k_T": 1.0, "J_m": 0.01, "f_m": 0.05}


def multisine(rng, low=0.2, high=40.0):
    lines = np.unique(np.round(np.geomspace(low, high, 60) * N * T)) / (N * T)
    t = T * np.arange(N)
    x = sum(np.cos(2 * np.pi * f * t + rng.uniform(0, 2 * np.pi)) for f in lines)
    return x / np.std(x)


def one_mass(u, gravity=0.0):
    angle, speed, h, found = 0.0, 0.0, T / STEPS, np.zeros(N)
    for i in range(N):
        found[i] = angle
        for _ in range(STEPS):
            speed += h / ONE["J_m"] * (u[i] - ONE["f_m"] * speed - gravity * np.sin(angle))
            angle += h * speed
    return found


def logged(u, angle):
    return Record(
        time=T * np.arange(N), torque=u, angle=angle, increment=np.diff(angle, prepend=0.0) / T
    )


@pytest.fixture(scope="module")
def u():
    return multisine(np.random.default_rng(3))


@pytest.fixture(scope="module")
def record(u):
    return logged(u, one_mass(u))


@pytest.mark.parametrize("delay", [-1.0, 5.0, float("nan")])
def test_a_delay_that_cannot_be_is_refused_with_those_that_can(record, delay):
    with pytest.raises(LogError, match=r"between -0\.016 s and 0\.016 s\."):
        identify(record, find_axis("one_mass"), delay=delay)


def test_a_mode_beyond_the_rate_is_refused():
    """At 250 Hz nothing is seen of a mode at 400 Hz."""
    model = find_axis("two_mass").having(TWO).model
    _check_rate(model, T)
    stiff = find_axis("two_mass").having(TWO | {"k": 300.0 * 400}).model
    with pytest.raises(LogError, match=r"cannot show a mode at .*--start"):
        _check_rate(stiff, T)
