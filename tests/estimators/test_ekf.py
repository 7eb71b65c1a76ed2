"""The joint extended Kalman filter against a textbook one, written out with matrix exponentials."""

from functools import partial

import numpy as np
import pytest
from acceptance.axes import theta_of
from acceptance.textbook import measured, predicted, sampled

from flexaxis.estimators import three_mass
from flexaxis.estimators.filters.design import make_design
from flexaxis.estimators.methods.ekf import joint_ekf

T = 0.005


def textbook(nominal, loop, N, *, P0, W, sigma, output="speed"):
    """θ (N, 3), the Kalman equations one by one."""
    step = partial(sampled, nominal, increments=output == "increment")
    m = 8 if output == "speed" else 9
    h = np.zeros(m)
    h[5 if output == "speed" else 8] = 1 / T if output == "increment" else 1.0
    y = read(loop, output)
    xi = np.r_[theta_of(nominal), np.zeros(m - 3)]
    P = np.diag(np.r_[P0 + W, np.zeros(m - 3)])
    if output == "angle":
        P[8, 8] = 10.0**2
    theta = np.empty((N, 3))
    for k in range(N):
        xi, P, _ = measured(xi, P, h, y[k], sigma)
        theta[k] = xi[:3]
        xi, P = predicted(partial(step, u=loop.u[k]), xi, P, W)
    return theta


def read(loop, output):
    return {"speed": loop.y, "increment": loop.increment, "angle": loop.angle}[output]


@pytest.mark.parametrize("output", ["speed", "increment", "angle"])
def test_against_the_textbook(nominal, loop, output):
    N = 200
    theta0 = theta_of(nominal)
    P0, W = (0.1 * theta0) ** 2, (1e-3 * theta0) ** 2
    expected = textbook(nominal, loop, N, P0=P0, W=W, sigma=0.1, output=output)
    ekf = joint_ekf(
        make_design(
            three_mass(nominal), P0=P0, drift=W, noise=0.1, period=T, output=output, corrects=True
        )
    )
    theta = ekf.run(loop.u[:N], read(loop, output)[:N])
    # central differences of step 1e-5 are good to some 1e-9
    np.testing.assert_allclose(theta, expected, rtol=1e-6)
