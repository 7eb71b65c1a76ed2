"""The square-root unscented Kalman filter against filterpy's, and against the Kalman filter."""

import numpy as np
import pytest
from scipy.linalg import expm

from flexaxis.estimators import EstimatorError, three_mass
from flexaxis.estimators.filters.design import make_design
from flexaxis.estimators.methods.ekf import joint_ekf
from flexaxis.estimators.methods.ukf import joint_ukf

TRUTH = np.array([1.0, 1.25, 0.05])
T = 0.005
TIGHT = {"P0": (0.1 * TRUTH) ** 2, "drift": (1e-3 * TRUTH) ** 2, "period": T, "noise": 0.1}


def exact_step(by_hand, nominal, xi, u, *, increments):
    q = nominal | {"k_T": xi[0], "J_a": 1 / xi[1], "f_m": xi[2]}
    A, B = by_hand(q)
    x = xi[3:].copy()
    if increments:
        x[5] = 0.0  # the motor angle counts from the start of the sample
    n = len(x)
    block = np.block([[A[:n, :n], B[:n, None]], [np.zeros((1, n + 1))]])
    return np.r_[xi[:3], (expm(block * T) @ np.r_[x, u])[:n]]


def textbook(by_hand, nominal, loop, N, *, spread, increments):
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
                exact_step(by_hand, nominal, x, loop.u[k], increments=increments)
                for x in (xi, *(xi + reach), *(xi - reach))
            ]
        )
    return theta


@pytest.mark.parametrize(("output", "spread"), [("speed", 1.0), ("increment", 1.3)])
def test_against_the_textbook(nominal, loop, by_hand, output, spread):
    N = 40
    increments = output == "increment"
    expected = textbook(by_hand, nominal, loop, N, spread=spread, increments=increments)
    ours = joint_ukf(make_design(three_mass(nominal), output=output, **TIGHT), spread=spread)
    theta = ours.run(loop.u[:N], (loop.increment if increments else loop.y)[:N])
    # the textbook's Cholesky factors need a little covariance of x, which ours does not
    np.testing.assert_allclose(theta, expected, rtol=1e-6)
    assert abs(theta - TRUTH).max() > 1e-3


def test_against_filterpy(nominal, loop, by_hand):
    kalman = pytest.importorskip("filterpy.kalman")
    N, m = 30, 8
    points = kalman.MerweScaledSigmaPoints(m, alpha=1.0, beta=2.0, kappa=0.0)
    u = iter(loop.u)
    rival = kalman.UnscentedKalmanFilter(
        m, 1, T, points=points, hx=lambda xi: xi[5:6],
        fx=lambda xi, dt, u: exact_step(by_hand, nominal, xi, u, increments=False),
    )  # fmt: skip
    rival.x = np.r_[TRUTH, np.zeros(5)]
    rival.P = np.diag(np.r_[TIGHT["P0"] + TIGHT["drift"], np.full(5, 1e-18)])
    rival.Q = np.diag(np.r_[TIGHT["drift"], np.full(5, 1e-22)])
    rival.R = np.array([[0.01]])
    expected = [TRUTH]
    for k in range(1, N):
        rival.predict(u=next(u))
        rival.update(loop.y[k : k + 1])
        expected.append(rival.x[:3].copy())
    theta = joint_ukf(make_design(three_mass(nominal), **TIGHT)).run(loop.u[:N], loop.y[:N])
    np.testing.assert_allclose(theta, expected, rtol=1e-5)


def test_with_nearly_certain_parameters_both_are_the_kalman_filter(nominal, loop):
    """Near a known θ all is linear, and what is left goes with the deviation, 1e-4, squared."""
    small = {"P0": (1e-4 * TRUTH) ** 2, "drift": (1e-6 * TRUTH) ** 2, "period": T, "noise": 0.1}
    unscented = joint_ukf(make_design(three_mass(nominal), **small))
    extended = joint_ekf(make_design(three_mass(nominal), **small))
    a, b = (f.run(loop.u[:1000], loop.y[:1000]) / TRUTH - 1 for f in (unscented, extended))
    assert abs(a).max() > 2e-5
    np.testing.assert_allclose(a, b, atol=1e-7)
    np.testing.assert_allclose(unscented.covariance, extended.covariance, rtol=1e-3, atol=1e-15)


def test_a_gap_lets_the_covariance_grow(nominal, loop):
    ukf = joint_ukf(make_design(three_mass(nominal), **TIGHT))
    ukf.run(loop.u[:1000], loop.y[:1000])
    before, theta = ukf.covariance, ukf.theta
    for u in loop.u[1000:1050]:
        ukf.step(u, None)
    np.testing.assert_allclose(ukf.theta, theta, rtol=1e-10)
    growth = (ukf.covariance - before).diagonal() / TIGHT["drift"]
    np.testing.assert_allclose(growth, 50, rtol=1e-6)


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
