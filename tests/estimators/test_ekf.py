"""The joint extended Kalman filter against a textbook one, written out with matrix exponentials."""

from functools import partial

import numpy as np
import pytest
from acceptance.textbook import sampled

from flexaxis.estimators import three_mass
from flexaxis.estimators.filters.design import make_design
from flexaxis.estimators.methods.ekf import joint_ekf

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
