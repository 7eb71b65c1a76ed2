"""Inverse dynamics against axes that are integrated here, in steps of their own."""

import numpy as np
import pytest

from flexaxis.estimators.offline.inverse import inverse_dynamics
from flexaxis.estimators.offline.prediction_error import jackknife

T, N, FINE = 1e-3, 12_000, 20
J, F, F_C = 0.02, 0.1, 0.3


def driven(top, *, hump=0.0, sided=0.0, gravity=0.0):
    """Return torque, mean speed and angle half way of an axis on two sines up to `top` [Hz]."""
    t = (np.arange(N * FINE) + 0.5) * T / FINE
    path = 3.0 * np.sin(2 * np.pi * 0.7 * t) + 0.6 / top * np.sin(2 * np.pi * top * t)
    speed = np.gradient(path, T / FINE)
    law = F_C * (1 + hump * np.exp(-((speed / 0.5) ** 2))) * np.sign(speed) + F * speed
    torque = J * np.gradient(speed, T / FINE) + law + sided * abs(speed) + gravity * np.sin(path)
    return (x.reshape(N, FINE).mean(axis=1) for x in (torque, speed, path))


def fitted(names, *signals):
    return inverse_dynamics(*signals, np.ones(N, bool), T, names)


LINEAR = ("inertia", "viscous", "dry", "constant")


@pytest.mark.parametrize("top", [5.0, 60.0])
def test_the_coefficients_of_a_rigid_axis_in_fast_motion(top):
    axis = fitted(LINEAR, *driven(top))
    for name, value in (("inertia", J), ("viscous", F), ("dry", F_C)):
        assert axis[name][0] == pytest.approx(value, rel=0.01), name
    assert abs(axis["constant"][0]) < 0.01 * F_C


def test_two_sides_and_gravity_are_told_apart():
    signals = driven(5.0, sided=0.03, gravity=0.4)
    axis = fitted((*LINEAR, "sided", "sine", "cosine"), *signals)
    assert axis["sided"][0] == pytest.approx(0.03, rel=0.02)
    assert axis["sine"][0] == pytest.approx(0.4, rel=0.01)
    assert axis["sine"][0] > 10 * axis["sine"][1]


def test_what_hardly_moves_has_no_coefficients():
    still = np.zeros(N)
    ok = np.arange(N) < 100
    assert inverse_dynamics(still, still + 1.0, still, ok, T, LINEAR) == {}


def test_beside_white_noise_the_jackknife_says_what_a_covariance_says():
    rng, ratios = np.random.default_rng(5), []
    for _ in range(60):
        rows = rng.standard_normal((2, 2000)) * [[1.0], [3.0]]
        _, deviation = jackknife(rows, rng.standard_normal(2000), np.ones(2000, bool))
        ratios.append(deviation / np.sqrt(np.diag(np.linalg.inv(rows @ rows.T))))
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(ratios), axis=0)), 1.0, rtol=0.15)
