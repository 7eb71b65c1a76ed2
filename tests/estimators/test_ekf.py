"""The joint extended Kalman filter against a textbook one, written out with matrix exponentials."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from acceptance.textbook import sampled

from flexaxis.estimators import three_mass
from flexaxis.estimators.filters.design import make_design
from flexaxis.estimators.methods.ekf import joint_ekf
from flexaxis.estimators.models.axes import LIMIT, with_angle

T = 0.005


def textbook(nominal, loop, N, *, P0, W, sigma, increments=False):
    """θ (N, 3): central differences of the exact step as Jacobian, Kalman equations one by one."""
    step = partial(sampled, nominal, increments=increments)
    m = 9 if increments else 8
    h = np.zeros(m)
    h[8 if increments else 5] = 1 / T if increments else 1.0
    y = loop.increment if increments else loop.y
    xi = np.r_[[nominal["k_T"], 1 / nominal["J_a"], nominal["f_m"]], np.zeros(m - 3)]
    P = np.zeros((m, m))
    P[:3, :3] = np.diag(P0 + W)
    theta = np.empty((N, 3))
    for k in range(N):
        K = P @ h / (h @ P @ h + sigma**2)
        xi = xi + K * (y[k] - h @ xi)
        P = P - np.outer(K, h @ P)
        theta[k] = xi[:3]
        size = np.r_[abs(xi[:3]), np.full(m - 3, 1.0)] * 1e-5
        F = np.column_stack(
            [
                (step(xi + d, loop.u[k]) - step(xi - d, loop.u[k])) / (2 * d.max())
                for d in np.diag(size)
            ]
        )
        xi = step(xi, loop.u[k])
        P = F @ P @ F.T
        P[:3, :3] += np.diag(W)
    return theta


@pytest.mark.parametrize("output", ["speed", "increment"])
def test_against_the_textbook(nominal, loop, output):
    N = 200
    theta0 = np.array([1.0, 1.25, 0.05])
    P0, W = (0.1 * theta0) ** 2, (1e-3 * theta0) ** 2
    expected = textbook(nominal, loop, N, P0=P0, W=W, sigma=0.1, increments=output == "increment")
    ekf = joint_ekf(
        make_design(three_mass(nominal), P0=P0, drift=W, noise=0.1, period=T, output=output)
    )
    y = loop.y if output == "speed" else loop.increment
    theta = ekf.run(loop.u[:N], y[:N])
    # central differences of step 1e-5 are good to some 1e-9
    np.testing.assert_allclose(theta, expected, rtol=1e-6)


def make(nominal, **options):
    theta0 = np.array([1.0, 1.25, 0.05])
    given = {"P0": (0.2 * theta0) ** 2, "drift": (2e-4 * theta0) ** 2, "period": T, "noise": 0.1}
    return joint_ekf(make_design(three_mass(nominal), **(given | options)))


def test_a_gap_lets_the_covariance_grow(nominal, loop):
    ekf = make(nominal)
    ekf.run(loop.u[:2000], loop.y[:2000])
    before, theta = ekf.covariance, ekf.theta
    for u in loop.u[2000:2100]:
        ekf.step(u, None)
    np.testing.assert_array_equal(ekf.theta, theta)
    growth = (ekf.covariance - before).diagonal() / (2e-4 * np.array([1.0, 1.25, 0.05])) ** 2
    np.testing.assert_allclose(growth, 100, rtol=1e-6)


@pytest.mark.slow  # a loop with laws is compiled for it
def test_a_law_that_does_nothing_changes_nothing(nominal, loop):
    """With a limit of the torque far away the states of the filter end before those of its law."""
    linear = with_angle(three_mass(nominal))
    limited = replace(with_angle(three_mass(nominal | {"torque_limit": 1e3})), laws=(LIMIT,))
    options = {"P0": (0.2, 0.2, 0.01), "drift": (4e-8, 6e-8, 1e-10), "period": T, "noise": 0.1}
    one, other = (
        joint_ekf(make_design(model, identify=("k_T", "1/J_a", "f_m"), **options)).run(
            loop.u[:400], loop.y[:400]
        )
        for model in (linear, limited)
    )
    assert abs(one[-1] / one[0] - 1).min() > 1e-3
    np.testing.assert_allclose(other, one, rtol=1e-7)  # the series of a part is good to 1e-9


def test_the_covariance_stays_positive_definite(nominal, loop):
    ekf = make(nominal)
    for _ in range(5):  # 60 000 samples
        ekf.run(loop.u, loop.y)
    P = ekf.state["P"]
    np.testing.assert_array_equal(P, P.T)
    scale = np.sqrt(P.diagonal())
    assert np.linalg.eigvalsh(P / np.outer(scale, scale))[0] > -1e-9
    assert (ekf.covariance.diagonal() > 0).all()


@pytest.mark.slow
def test_other_parameters(nominal, loop):
    names = ("J_m", "1/k_a")
    truth = np.array([nominal["J_m"], 1 / nominal["k_a"]])
    design = make_design(
        three_mass(nominal), identify=names, theta0=1.1 * truth, P0=(0.1 * truth) ** 2,
        drift=(5e-5 * truth) ** 2, period=T, noise=0.1,
    )  # fmt: skip
    ekf = joint_ekf(design)
    np.testing.assert_allclose(ekf.run(loop.u, loop.y)[-1], truth, rtol=0.01)
