"""The bounds, met by an estimator that should meet them: by simulation, within its interval."""

import numpy as np
import pytest

from flexaxis.estimators import three_mass
from flexaxis.estimators.sampling.extended import sampled_system
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring import bounds
from flexaxis.sim.parameters import preset
from flexaxis.sim.simulate import simulate

NAMES = ("k_T", "1/J_a", "f_m")
NOMINAL = preset("n1").as_dict()


@pytest.fixture(scope="module")
def record():
    return simulate(find_scenario("fm_step-v1"), [0])[0]


def outputs(theta, u, x):
    """Speed of the axis from the state x, by its own sampled matrices."""
    model = three_mass(NOMINAL).parametrize(NAMES)
    transition, gain, _ = sampled_system(model, theta, 0.005)
    A, b, y = transition[-5:, -5:], gain[-5:], []
    for torque in u:
        y.append(x[2])
        x = A @ x + b * torque
    return np.array(y)


def test_the_gradient_after_a_jump_against_finite_differences(record):
    model = three_mass(NOMINAL).parametrize(NAMES)
    theta, u, x = model.theta, record.torque[2000:2200], np.array([1e-4, -2e-4, 3.0, 0.02, 0.03])
    psi = bounds.jump_gradient(model, theta, u, x, period=0.005)
    assert not psi[0].any()
    for i, h in enumerate(np.diag(1e-5 * theta)):
        slope = (outputs(theta + h, u, x) - outputs(theta - h, u, x)) / (2 * h[i])
        np.testing.assert_allclose(psi[:, i], slope, rtol=1e-5, atol=1e-7 * abs(slope).max())


def test_an_oracle_fit_meets_the_cramer_rao_bound(record):
    """Least squares from the true state and time, 400 runs of new noise."""
    model = three_mass(NOMINAL).parametrize(NAMES)
    theta, u, x, n = model.theta, record.torque[2000:2300], np.zeros(5), 299
    clean, psi = outputs(theta, u, x), bounds.jump_gradient(model, theta, u, x, period=0.005)
    C = bounds.cramer_rao(psi, 0.01, theta)[n]
    noise = 0.1 * np.random.default_rng(0).standard_normal((400, 300))
    found = []
    for e in noise:
        guess = 1.01 * theta  # two steps of Gauss–Newton are enough from here
        for _ in range(2):
            slope = bounds.jump_gradient(model, guess, u, x, period=0.005)
            guess = guess + np.linalg.lstsq(slope, clean + e - outputs(guess, u, x))[0]
        found.append(guess)
    ratio = np.var(found, axis=0) / np.diag(C)
    # a variance from 400 runs is known to ±7 %; the prior of the bound adds less than 1 %
    assert (abs(ratio - 1) < 0.25).all(), ratio


def test_the_bound_of_a_scenario_uses_state_and_parameters_at_its_fault(record):
    scenario = find_scenario("fm_step-v1")
    u = record.torque
    both = bounds.jump_bound(scenario, NAMES, 2000, 3000, u)
    deviation = both.unknown
    assert deviation.shape == (1000, 3)
    # before anything is measured the prior: half of each parameter after the jump
    np.testing.assert_allclose(deviation[0], [0.5, 0.625, 0.0375], rtol=1e-9)
    assert (np.diff(deviation, axis=0) <= 1e-12).all()
    assert 0.02 < bounds.lag_bound(deviation[:, 2], 0.025, period=0.005) < 0.12
    # who knows that it is f_m alone knows more, and what he knows is what a model of f_m has
    assert (both.single <= deviation + 1e-15).all()
    alone = bounds.jump_bound(scenario, ["f_m"], 2000, 3000, u)
    np.testing.assert_allclose(both.single[:, 2], alone.unknown[:, 0], rtol=1e-12)


def test_a_friction_that_falls_to_zero_has_a_bound(record):
    scenario = find_scenario("fm_step-v1").override({"fault[0].factor": 0.0})
    both = bounds.jump_bound(scenario, NAMES, 2000, 3000, record.torque)
    assert np.isfinite(both.unknown).all() and both.unknown[0, 2] == pytest.approx(0.025)


def regression(rng, N, walk, sigma=0.1):
    """ψ, the path of θ and y of a linear regression whose parameters walk."""
    psi = rng.standard_normal((N, 2)) * [1.0, 3.0]
    theta = np.cumsum(rng.multivariate_normal([0, 0], walk, N), axis=0)
    return psi, theta, np.sum(psi * theta, axis=1) + sigma * rng.standard_normal(N)


def test_forgetting_has_the_covariance_of_the_theory():
    rng, Q, nu = np.random.default_rng(1), np.diag([1.0, 9.0]), 0.005
    walk = np.diag([2.5e-7, 2.8e-8])
    psi, theta, y = regression(rng, 120_000, walk)
    estimate, P, errors = np.zeros(2), np.eye(2) * nu, []
    for row, truth, value in zip(psi, theta, y, strict=True):
        gain = P @ row / (1 + row @ P @ row)
        estimate = estimate + gain * (value - row @ estimate)
        P = (P - np.outer(gain, row @ P)) / (1 - nu)
        errors.append(estimate - truth)
    measured = np.var(errors[4000:], axis=0)
    expected = np.diag(bounds.tracking_covariance(Q, 0.01, forgetting=1 - nu, walk=walk))
    # 116 000 samples hold 600 time constants: ±6 % on a variance
    np.testing.assert_allclose(measured, expected, rtol=0.2)


def test_covariance_modification_has_the_variance_of_the_theory():
    rng, Q = np.random.default_rng(2), np.diag([1.0, 9.0])
    walk, drift = np.diag([2.5e-7, 2.8e-8]), np.diag([2.5e-5, 2.8e-6])
    psi, theta, y = regression(rng, 120_000, walk)
    estimate, P, errors = np.zeros(2), np.sqrt(drift @ np.linalg.inv(Q)), []
    for row, truth, value in zip(psi, theta, y, strict=True):
        gain = P @ row / (1 + row @ P @ row)
        estimate = estimate + gain * (value - row @ estimate)
        P = P - np.outer(gain, row @ P) + drift
        errors.append(estimate - truth)
    P = np.sqrt(drift @ np.linalg.inv(Q))
    expected = bounds.drift_tracking_variance(Q, 0.01, P=P, walk=walk)
    np.testing.assert_allclose(np.var(errors[4000:], axis=0), expected, rtol=0.2)


def test_the_kalman_filter_is_on_the_posterior_bound_and_no_filter_below():
    rng, walk, start = np.random.default_rng(3), np.diag([1e-5, 1e-6]), np.eye(2)
    errors = []
    psi = rng.standard_normal((300, 2)) * [1.0, 3.0]
    bound = bounds.posterior_bound(psi, 0.01, walk=walk, start=start)[-1]
    for _ in range(400):
        truth, estimate, P = rng.standard_normal(2), np.zeros(2), start
        for row in psi:
            truth, P = truth + rng.standard_normal(2) * np.sqrt(np.diag(walk)), P + walk
            gain = P @ row / (0.01 + row @ P @ row)
            y = row @ truth + 0.1 * rng.standard_normal()
            estimate, P = estimate + gain * (y - row @ estimate), P - np.outer(gain, row @ P)
        errors.append(estimate - truth)
    np.testing.assert_allclose(np.var(errors, axis=0), np.diag(bound), rtol=0.25)  # ±7 %, as above


def test_validity():
    # 200 samples of 5 ms are a second; the slowest pole takes half of one
    assert bounds.validity([200, 400], [-2 + 90j, -2 - 90j, -30, 0], period=0.005) == pytest.approx(
        2.0
    )
