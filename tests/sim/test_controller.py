"""The vectorised loop against the textbook loop, one scalar at a time."""

import math

import numpy as np
import pytest

from flexaxis.sim.tables.controller import Controller, ControllerConfig

T = 1 / 200


def textbook(reference, angle, *, Kp=4.0, Kv=0.22, Ki=2.0, tau=0.0005):
    a = math.exp(-T / tau) if tau else 0.0
    error_before = speed = integral = 0.0
    command = []
    for wanted, phi in zip(reference, angle, strict=True):
        error = wanted - phi
        speed = a * speed + (1 - a) * (error - error_before) / T
        error_before = error
        s = Kp * error + speed
        integral = integral + T * Ki * s
        command.append(Kv * (s + integral))
    return np.array(command)


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
        expected = textbook(signals[0][:, column], signals[1][:, column], **gains)
        # Another order of the products: rounding, which the integrator keeps but does not grow.
        assert np.allclose(command[:, column], expected, rtol=1e-12, atol=1e-13)


def test_a_run_has_the_same_bits_alone_and_in_any_batch(signals):
    together = run(*signals)
    assert np.array_equal(run(*signals[:, :, 3:4])[:, 0], together[:, 3])
    assert np.array_equal(run(*signals[:, :, [4, 0]]), together[:, [4, 0]])


def test_starts_from_rest():
    first = run(np.full((1, 1), 0.01), np.zeros((1, 1)))[0, 0]
    a = math.exp(-T / 0.0005)
    speed = 0.01 * 4.0 + (1 - a) * 0.01 / T
    assert first == pytest.approx(0.22 * speed * (1 + T * 2.0), rel=1e-14)
