"""Theory of slow adaptation, against closed forms and simulated recursions; resets of P."""

import numpy as np
import pytest

from flexaxis.estimators.offline.priors import estimate_covariance, steady_P

Q = np.array([[25.0, 4.0, -106.0], [4.0, 109.0, 27.0], [-106.0, 27.0, 1576.0]])
DRIFT = np.array([5e-8, 50e-8, 500e-8])


def regression(grow, P, steps, noise):
    """θ̂ of the scalar model y = θψ + e with white ψ of variance 4, truth 0."""
    rng, theta, kept = np.random.default_rng(0), 0.0, np.empty(steps)
    for k in range(steps):
        psi, e = 2 * rng.standard_normal(), noise * rng.standard_normal()
        P = P - (P * psi) ** 2 / (1 + P * psi**2)
        theta += P * psi * (e - psi * theta)
        P = grow(P)
        kept[k] = theta
    return kept


@pytest.mark.parametrize("drift", [DRIFT, np.diag(DRIFT) + 1e-8])
def test_modification_solves_its_equation(drift):
    P = steady_P(Q, drift=drift)
    full = np.diag(drift) if drift.ndim == 1 else drift
    np.testing.assert_allclose(P @ Q @ P, full, atol=1e-18)
    np.testing.assert_allclose(P, P.T, rtol=1e-9)
    assert np.linalg.eigvalsh(P).min() > 0


@pytest.mark.parametrize(
    "setting, grow",
    [({"forgetting": 0.99}, lambda P: P / 0.99), ({"drift": [1e-4 / 4]}, lambda P: P + 1e-4 / 4)],
)
def test_variance_is_half_of_P(setting, grow):
    """A recursion in the test, 200 000 samples of a memory of 100: some 2000 independent ones."""
    P = steady_P([[4.0]], **setting)[0, 0]
    theta = regression(grow, P, 200_000, 3.0)
    claimed = estimate_covariance([[P]], 9.0)[0, 0]
    # 2000 independent samples give 3 %; the theory is off by another (1−λ)-ish 2 %
    assert abs(np.var(theta) / claimed - 1) < 0.12
