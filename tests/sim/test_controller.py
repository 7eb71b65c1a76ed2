"""The vectorised loop against the textbook loop, one scalar at a time."""

import math

import numpy as np
import pytest

from flexaxis.sim.tables.controller import Controller, ControllerConfig

from .conftest import commanded

T = 1 / 200


def run(reference, angle, config=None):
    controller = Controller(config or ControllerConfig(), reference.shape[1], period=0.005)
    return np.array([controller.torque(w, p) for w, p in zip(reference, angle, strict=True)])


@pytest.fixture
def signals():
    return np.random.default_rng(0).normal(0, 0.05, (2, 300, 5))


@pytest.mark.parametrize("gains", [{}, {"Kp": 9.0, "Kv": 0.1, "Ki": 0.0}, {"tau": 0.01},
                                   {"tau": 0.0}])  # fmt: skip
def test_is_the_textbook_loop(signals, gains):
    command = run(*signals, ControllerConfig(**gains))
    for column in range(5):
        errors = signals[0][:, column] - signals[1][:, column]
        expected = [*commanded(errors, T, **gains)]
        # Another order of the products: rounding, which the integrator keeps but does not grow.
        assert np.allclose(command[:, column], expected, rtol=1e-12, atol=1e-13)


def test_starts_from_rest():
    first = run(np.full((1, 1), 0.01), np.zeros((1, 1)))[0, 0]
    a = math.exp(-T / 0.0005)
    speed = 0.01 * 4.0 + (1 - a) * 0.01 / T
    assert first == pytest.approx(0.22 * speed * (1 + T * 2.0), rel=1e-14)
