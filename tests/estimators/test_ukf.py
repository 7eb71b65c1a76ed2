"""The square-root unscented Kalman filter against the textbook, and against the Kalman filter."""

import numpy as np
import pytest
from acceptance.textbook import sampled

from flexaxis.estimators import EstimatorError, three_mass
from flexaxis.estimators.filters.design import make_design
from flexaxis.estimators.methods.ekf import joint_ekf
from flexaxis.estimators.methods.ukf import joint_ukf

TRUTH = np.array([1.0, 1.25, 0.05])
T = 0.005
TIGHT = {"P0": (0.1 * TRUTH) ** 2, "drift": (1e-3 * TRUTH) ** 2, "period": T, "noise": 0.1}


def textbook(nominal, loop, N, *, spread, increments):
    """θ (N, 3): full covariances and Cholesky factors, one equation at a time."""
    m, p = (9 if increments else 8), 3
    h = np.zeros(m)
    h[8 if increments else 5] = 1 / T if increments else 1.0
    y = loop.increment if increments else loop.y
    w = np.r_[1 - 1 / spread**2, np.full(2 * m, 1 / (2 * spread**2 * m))]
    v = w + np.r_[3 - spread**2, np.zeros(2 * m)]
    xi, P, W = np.r_[TRUTH, np.zeros(m - p)], np.zeros((m, m)), np.diag(TIGHT["drift"])
    P[:p, :p] = np.diag(TIGHT["P0"])
    points = None
    theta = np.empty((N, p))
    for k in range(N):
        if points is not None:
            xi = w @ points
            P = (points - xi).T @ np.diag(v) @ (points - xi)
            ys = points @ h
            s = v @ (ys - w @ ys) ** 2 + 0.1**2
            K = (points - xi).T @ (v * (ys - w @ ys)) / s
            xi = xi + K * (y[k] - w @ ys)
            P = P - s * np.outer(K, K)
        P[:p, :p] += W
        theta[k] = xi[:p]
        root = np.linalg.cholesky(P + 1e-22 * np.eye(m))  # x(0) is certain, P singular
        reach = spread * np.sqrt(m) * root.T
        points = np.array(
            [
                sampled(nominal, x, loop.u[k], increments=increments)
                for x in (xi, *(xi + reach), *(xi - reach))
            ]
        )
    return theta


@pytest.mark.parametrize(("output", "spread"), [("speed", 1.0), ("increment", 1.3)])
def test_against_the_textbook(nominal, loop, output, spread):
    N = 40
    increments = output == "increment"
    expected = textbook(nominal, loop, N, spread=spread, increments=increments)
    ours = joint_ukf(make_design(three_mass(nominal), output=output, **TIGHT), spread=spread)
    theta = ours.run(loop.u[:N], (loop.increment if increments else loop.y)[:N])
    # the textbook's Cholesky factors need a little covariance of x, which ours does not
    np.testing.assert_allclose(theta, expected, rtol=1e-6)
    assert abs(theta - TRUTH).max() > 1e-3


def test_with_nearly_certain_parameters_both_are_the_kalman_filter(nominal, loop):
    """Near a known θ all is linear, and what is left goes with the deviation, 1e-4, squared."""
    small = {"P0": (1e-4 * TRUTH) ** 2, "drift": (1e-6 * TRUTH) ** 2, "period": T, "noise": 0.1}
    unscented = joint_ukf(make_design(three_mass(nominal), **small))
    extended = joint_ekf(make_design(three_mass(nominal), **small))
    a, b = (f.run(loop.u[:1000], loop.y[:1000]) / TRUTH - 1 for f in (unscented, extended))
    assert abs(a).max() > 2e-5
    np.testing.assert_allclose(a, b, atol=1e-7)
    np.testing.assert_allclose(unscented.covariance, extended.covariance, rtol=1e-3, atol=1e-15)


def test_the_box_holds_and_the_filter_lasts(nominal, loop):
    theta0 = 1.2 * TRUTH
    box = 0.9 * theta0, 1.1 * theta0
    boxed = joint_ukf(make_design(three_mass(nominal), theta0=theta0, bounds=box, **TIGHT))
    theta = boxed.run(loop.u, loop.y)
    assert (theta >= 0.9 * theta0).all() and (theta <= 1.1 * theta0).all()
    assert np.isclose(theta[-1], 0.9 * theta0).any()  # the truth is outside
    assert (boxed.covariance.diagonal() > 0).all()


@pytest.mark.parametrize("spread", [0.1, 0.0])
def test_a_spread_that_cannot_be_is_refused(nominal, spread):
    with pytest.raises(EstimatorError, match=f"spread is {spread}"):
        joint_ukf(make_design(three_mass(nominal), **TIGHT), spread=spread)
