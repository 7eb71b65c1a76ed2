"""Theory of slow adaptation, against closed forms and simulated recursions; resets of P."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from flexaxis.estimators import EstimatorError, Rpem, three_mass
from flexaxis.estimators.offline.adaptation import (
    drift_for,
    estimate_covariance,
    steady_P,
    tracking_error,
)

Q = np.array([[25.0, 4.0, -106.0], [4.0, 109.0, 27.0], [-106.0, 27.0, 1576.0]])
DRIFT = np.array([5e-8, 50e-8, 500e-8])


def regression(P_update, steps, theta0=0.0, noise=1.0, rng=None):
    """θ̂ of the scalar model y = θψ + e with white ψ of variance 4, truth 0."""
    rng = rng or np.random.default_rng(0)
    theta, P, kept = theta0, P_update(None), np.empty(steps)
    for k in range(steps):
        psi, e = 2 * rng.standard_normal(), noise * rng.standard_normal()
        P = P - (P * psi) ** 2 / (1 + P * psi**2)
        theta += P * psi * (e - psi * theta)
        P = P_update(P)
        kept[k] = theta
    return kept


@pytest.mark.parametrize("drift", [DRIFT, np.diag(DRIFT) + 1e-8])
def test_modification_solves_its_equation(drift):
    P = steady_P(Q, drift=drift)
    full = np.diag(drift) if drift.ndim == 1 else drift
    np.testing.assert_allclose(P @ Q @ P, full, atol=1e-18)
    np.testing.assert_allclose(P, P.T, rtol=1e-9)
    assert np.linalg.eigvalsh(P).min() > 0


def test_needs_one_of_both():
    for options in ({}, {"forgetting": 0.99, "drift": DRIFT}):
        with pytest.raises(EstimatorError, match="either"):
            steady_P(Q, **options)


@pytest.mark.parametrize("forgetting", [True, False])
def test_variance_is_half_of_P(forgetting):
    """A recursion in the test, 200 000 samples of a memory of 100: some 2000 independent ones."""
    P = steady_P([[4.0]], **({"forgetting": 0.99} if forgetting else {"drift": [1e-4 / 4]}))[0, 0]
    update = (
        (lambda p: P if p is None else p / 0.99)
        if forgetting
        else (lambda p: P if p is None else p + 1e-4 / 4)
    )
    theta = regression(update, 200_000, noise=3.0)
    claimed = estimate_covariance([[P]], 9.0)[0, 0]
    # 2000 independent samples give 3 %; the theory is off by another (1−λ)-ish 2 %
    assert abs(np.var(theta) / claimed - 1) < 0.12


def test_covariance_solves_the_lyapunov_equation():
    for P in (steady_P(Q, forgetting=0.995), steady_P(Q, drift=DRIFT)):
        expected = solve_continuous_lyapunov(P @ Q, 0.01 * P @ Q @ P)
        np.testing.assert_allclose(estimate_covariance(P, 0.01), expected, rtol=1e-8)


def test_uncorrelated_parameters_get_their_time_constants():
    wanted = np.array([2.0, 0.5, 1.0])
    diagonal = np.diag(np.diag(Q))
    P = steady_P(diagonal, drift=drift_for(wanted, diagonal, period=0.005))
    np.testing.assert_allclose(P @ diagonal, np.diag(0.005 / wanted), atol=1e-15)
    left = tracking_error(P, diagonal, [1.0], period=0.005)[0]
    np.testing.assert_allclose(left, np.diag(np.exp(-1.0 / wanted)), atol=1e-12)


def test_correlated_ones_get_a_common_one_from_the_coupled_drift():
    P = steady_P(Q, drift=drift_for(np.ones(3), Q, coupled=True, period=0.005))
    np.testing.assert_allclose(P @ Q, 0.005 * np.eye(3), atol=1e-12)
    diagonal = drift_for(np.ones(3), Q, period=0.005)
    np.testing.assert_allclose(diagonal, np.diag(0.005**2 / np.diag(Q)))
    slowed = steady_P(Q, drift=diagonal)
    assert np.linalg.eigvals(slowed @ Q).real.min() < 0.9 * 0.005


def test_error_decays_as_predicted():
    """The mean of recursions in the test, without noise."""
    drift = drift_for([0.5], [[4.0]], period=0.005)[0, 0]  # 100 samples
    P = steady_P([[4.0]], drift=[drift])[0, 0]
    update = lambda p: P if p is None else p + drift  # noqa: E731
    runs = [
        regression(update, 201, theta0=1.0, noise=0.0, rng=np.random.default_rng(seed))
        for seed in range(100)
    ]
    predicted = tracking_error([[P]], [[4.0]], [0.5, 1.0], period=0.005)[:, 0, 0]
    np.testing.assert_allclose(predicted, np.exp([-1, -2]))
    # of 100 runs: spread of a product of 100 random factors 1−Pψ², some 15 % each
    np.testing.assert_allclose(np.mean(runs, axis=0)[[99, 199]], predicted, rtol=0.08)


def test_an_error_disturbs_whoever_its_gradient_is_correlated_with():
    """Of P and Q that do not commute, beside the recursion θ̃ ← θ̃ − P Q θ̃ itself."""
    P, correlated = np.diag([1e-4, 4e-3]), np.array([[2.0, 1.0], [1.0, 3.0]])
    left = tracking_error(P, correlated, [0.5], period=0.005)[0]
    step = np.eye(2) - P @ correlated
    np.testing.assert_allclose(left, np.linalg.matrix_power(step, 100), atol=0.005)


def test_a_time_constant_is_longer_than_a_sample():
    with pytest.raises(EstimatorError, match="longer than a sample"):
        drift_for([1.0, 0.004, 1.0], Q, period=0.005)


def test_P_can_be_reset(nominal, simulated):
    """A filter that is told of a change follows faster, and from the P it was given."""
    changed = dict(nominal, f_m=0.075)
    loop = simulated(12.0, faults={6.0: changed})
    told, untold = (
        Rpem(three_mass(nominal), P0=[2.97e-4, 5.19e-5, 4.69e-6], period=0.005) for _ in range(2)
    )
    for estimator in (told, untold):
        estimator.run(loop.u[:1200], loop.y[:1200])
    told.P = (0.03 * np.array([1, 1.25, 0.05])) ** 2 / 0.01
    np.testing.assert_array_equal(np.diag(told.P), (0.03 * np.array([1, 1.25, 0.05])) ** 2 / 0.01)
    errors = [
        np.abs(estimator.run(loop.u[1200:1500], loop.y[1200:1500])[:, 2] - 0.075).mean()
        for estimator in (told, untold)
    ]
    assert errors[0] < 0.5 * errors[1]
    with pytest.raises(EstimatorError, match="positive definite"):
        told.P = [1.0, 1.0, -1.0]
