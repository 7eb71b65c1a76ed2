"""Scores, theory and bounds against what is worked out here: by hand, by simulation, by scipy."""

import numpy as np
import pytest
from acceptance.axes import held, system
from scipy.stats import halfnorm

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring import bounds
from flexaxis.experiments.scoring.bounds import limits
from flexaxis.sim.parameters import preset
from flexaxis.sim.simulate import simulate

NAMES = ("k_T", "1/J_a", "f_m")
T = 0.005


def driven(parameters, x, u):
    """Motor speed at each sample from the state x on, and the state after the last."""
    A, B = (part[:5] for part in system(parameters))
    step, speed = held(A[:, :5], B, T), []
    for torque in u:
        speed.append(x[2])
        x = step @ np.append(x, torque)
    return np.array(speed), x


@pytest.fixture(scope="module")
def jump():
    """Torque of fm_step-v1, and deviations (1000, 3) of the bound after its fault, by hand."""
    u = simulate(find_scenario("fm_step-v1"), [0])[0].torque
    before = preset("n1").as_dict()
    _, x = driven(before, np.zeros(5), u[:2000])
    assert abs(x).max() > 0.1  # the axis is moving

    theta = np.array([before["k_T"], 1 / before["J_a"], 1.5 * before["f_m"]])

    def speed(values):
        k_T, inverse, f_m = values
        return driven(before | {"k_T": k_T, "J_a": 1 / inverse, "f_m": f_m}, x, u[2000:3000])[0]

    steps = np.diag(1e-5 * theta)
    psi = np.array([(speed(theta + h) - speed(theta - h)) / (2 * h.sum()) for h in steps]).T
    information = np.diag(1 / (0.5 * theta) ** 2) + np.zeros((1000, 3, 3))
    information += np.cumsum(psi[:, :, None] * psi[:, None, :], axis=0) / 0.1**2
    deviation = np.sqrt([np.diag(np.linalg.inv(J)) for J in information])
    return u, deviation


def test_the_bound_after_a_jump_by_matrix_exponential_and_differences(jump):
    u, by_hand = jump
    found = bounds.jump_bound(find_scenario("fm_step-v1"), NAMES, 2000, 3000, u)
    # differences of 1e-5 are good to about 1e-9
    np.testing.assert_allclose(found.unknown, by_hand, rtol=1e-6)


def test_the_lag_on_the_bound_is_that_of_the_mean_modulus_of_a_normal_error(jump):
    u, by_hand = jump
    limit = limits(find_scenario("fm_step-v1"), NAMES, u)["f_m"]
    size = 0.5 * 0.05
    modulus = halfnorm(scale=by_hand[:, 2] / size).mean()
    assert limit["lag_bound"] == pytest.approx(T * np.minimum(1, modulus).sum(), rel=1e-6)


@pytest.mark.parametrize(("start", "seconds"), [(1.0, 5.0), (1.2, 3.0), (1.5, 0.0)])
def test_doing_nothing_is_staying_at_what_one_was_told(jump, start, seconds):
    """Told 1.2 of what becomes 1.5: 0.3 off for 5 s, by a fault of 0.5."""
    scenario = find_scenario("fm_step-v1").override({"start": start})
    assert limits(scenario, NAMES, jump[0])["f_m"]["lag_null"] == pytest.approx(seconds, abs=1e-9)
