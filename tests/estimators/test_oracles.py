"""Estimators where the answer is known: closed forms, textbook loops, exact data."""

import numpy as np
import pytest
from acceptance.axes import held

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.models.discretisation import plan
from flexaxis.estimators.registry import REGISTRY

T = 0.005
made = {name: entry.factory for name, entry in REGISTRY.items()}
NAMES = ("k_T", "1/J_a", "f_m")
FILTERS = {
    "rpem": made["rpem-forgetting"],
    "ekf": made["ekf"],
    "imm": made["imm"],
}


@pytest.fixture(scope="module")
def stiff(nominal, simulated):
    """An axis with a gear of a thousandfold stiffness, and 3 s of it without noise."""
    parameters = dict(nominal) | {"k_g": 1e3 * nominal["k_g"]}
    return parameters, simulated(3.0, parameters=parameters, sigma=0.0)


@pytest.mark.parametrize("output", ["speed", "increment"])
@pytest.mark.parametrize("name", FILTERS)
def test_at_the_truth_exact_data_of_a_stiff_axis_move_nothing(stiff, name, output):
    """Several substeps take one sample: none may be lost or counted twice."""
    parameters, run = stiff
    model = three_mass(parameters).parametrize(NAMES)
    assert plan(model, 0.1 * model.theta, 10 * model.theta, T)[2] > 1
    more = {"torque": run.u} if name == "rpem" else {}  # nothing is stored for such an axis
    estimator = FILTERS[name](parameters, T, output=output, **more)
    theta = estimator.run(run.u, run.y if output == "speed" else run.increment)
    np.testing.assert_allclose(theta / model.theta, 1.0, atol=1e-10, rtol=0)


@pytest.fixture(scope="module")
def linear(nominal, by_hand):
    """k_T multiplies all that the axis does from rest: torque (N,), and speed for k_T = 1."""
    A, B = by_hand(dict(nominal) | {"k_T": 1.0})
    step = held(A, B, T)
    u = np.random.default_rng(4).normal(0, 1, 300)
    x, speed = np.zeros(6), []
    for torque in u:
        speed.append(x[2])
        x = step[:6, :6] @ x + step[:6, 6] * torque
    return u, np.array(speed)


def test_a_corrected_state_is_that_of_the_present_parameters(nominal, linear):
    """Then x = k_T x₁ exactly, and the filter is least squares in closed form."""
    u, speed = linear
    y = 1.3 * speed + 0.1 * np.random.default_rng(5).standard_normal(len(u))
    factor, P0 = 0.99, 0.2
    ours = Rpem(
        three_mass(nominal),
        identify=["k_T"],
        P0=[P0],
        forgetting=factor,
        state_correction=True,
        period=0.005,
    )
    theta = ours.run(u, y)[:, 0]
    for k in (1, 10, 100, 299):
        weights = factor ** np.arange(k, -1.0, -1.0)
        start = weights[0] / P0  # the first time update comes after the first measurement
        total = start + np.sum(weights * speed[: k + 1] ** 2)
        expected = start * nominal["k_T"] + np.sum(weights * speed[: k + 1] * y[: k + 1])
        assert theta[k] == pytest.approx(expected / total, rel=1e-9)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_an_outlier_is_clipped_at_deviations_of_the_prediction(nominal, loop, sign):
    """While P is large the prediction is uncertain, and a large residual is no outlier."""
    N, clip = 400, 3.0
    ours = Rpem(
        three_mass(nominal), P0=[1e-3, 1e-3, 1e-3], forgetting=0.995, robust=clip, period=0.005
    )
    ours.run(loop.u[:N], loop.y[:N])
    psi = ours.state["X"][-1, 1:4] / ours._design.scale
    ours.P = [1.0, 1.0, 1e-3]
    noise = ours.noise_variance
    s = 1 + psi @ ours.P @ psi
    assert s > 3  # the spread of the prediction counts
    expected = ours.P @ psi / s * sign * clip * np.sqrt(noise * s)
    before = ours.theta
    lower, upper = (ours.state[side] * ours._design.scale for side in ("lower", "upper"))
    assert ((before + expected > lower) & (before + expected < upper)).all()
    ours.step(loop.u[N], loop.y[N] + sign * 1e3)
    np.testing.assert_allclose(ours.theta - before, expected, rtol=1e-9)
